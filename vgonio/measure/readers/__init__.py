"""Readers of measured BRDFs, one format a file; the table of formats is `measure.formats`."""
