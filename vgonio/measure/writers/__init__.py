"""Files that other programs read, one format a file; the table is `measure.formats`."""
