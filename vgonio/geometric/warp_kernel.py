"""The kernel of the Warp tracer; Warp reads its source and its annotations, so they are no strings here."""

import warp as wp


@wp.kernel
def closest(
    mesh: wp.uint64,
    position: wp.array(dtype=wp.vec3),  # type: ignore[valid-type]
    direction: wp.array(dtype=wp.vec3),  # type: ignore[valid-type]
    reach: wp.float32,
    facet: wp.array(dtype=wp.int32),  # type: ignore[valid-type]
):
    i = wp.tid()
    query = wp.mesh_query_ray(mesh, position[i], direction[i], reach)
    if query.result:  # type: ignore[attr-defined]
        facet[i] = query.face  # type: ignore[attr-defined]
    else:
        facet[i] = -1
