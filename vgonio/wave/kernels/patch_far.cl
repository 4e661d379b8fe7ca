// What the points of a patch see of far directions, and the phases with which they send light there.

// Slope of the highest line of sight from every point along azimuths (cos, sin), on heights that reach beyond the patch.
__kernel void horizons(
    const int columns, const int rows, const int wide, const int high, const int margin, const int steps,
    const float pitch, const float highest,
    __global const float *restrict z,          // (high, wide): the patch with `margin` cells around it
    __global const float *restrict azimuth,    // (n, 2)
    __global float *restrict out)              // (n, rows, columns)
{
    const int ix = get_global_id(0), iy = get_global_id(1), n = get_global_id(2);
    if (ix >= columns || iy >= rows)
        return;
    const float c = azimuth[2 * n], s = azimuth[2 * n + 1];
    const float own = z[(iy + margin) * wide + ix + margin];
    float top = -1.0e30f;
    // beyond 32 cells a step is 1/32 of the distance: crests thinner than that, seen from there, are skipped
    for (float i = 1.0f; i <= steps; i += fmax(1.0f, 0.03125f * i)) {
        const float x = ix + margin + i * c, y = iy + margin + i * s;
        const int jx = (int)floor(x), jy = (int)floor(y);
        if (jx < 0 || jy < 0 || jx > wide - 2 || jy > high - 2)
            break;
        const float fx = x - jx, fy = y - jy;
        const __global float *p = z + jy * wide + jx;
        const float h = (p[0] * (1 - fx) + p[1] * fx) * (1 - fy) + (p[wide] * (1 - fx) + p[wide + 1] * fx) * fy;
        top = fmax(top, (h - own) / (i * pitch));
        if ((highest - own) / (i * pitch) < top)
            break;
    }
    out[((size_t)n * rows + iy) * columns + ix] = top;
}

// cos and sin of k w.r where a point sees the direction w, otherwise 0. Work-items: vectors along x, rows, directions.
__kernel void waves(
    const int rows, const int stride, const int count, const float middle_x, const float middle_y, const float pitch,
    __global const float *restrict z,            // (rows, stride)
    __global const float *restrict normal,       // (3, rows, stride), 0 in the padding
    __global const float *restrict horizon,      // (sheets, rows, stride)
    __global const float *restrict directions,   // (count, 8): w, k w / 2 pi, sin of the polar angle, share of sheet b
    __global const int *restrict sheets,         // (count, 2): a, b
    __global float *restrict out)                // (2, count, rows, stride)
{
    const int ix = get_global_id(0) * WIDTH, iy = get_global_id(1), n = get_global_id(2), here = iy * stride + ix;
    const size_t plane = rows * stride;
    __global const float *d = directions + 8 * n;
    const VEC x = (ix - middle_x + JOIN(convert_float, WIDTH)(LANES)) * pitch;
    const float y = (iy - middle_y) * pitch;
    const VEC line = (1.0f - d[7]) * LOAD(0, horizon + sheets[2 * n] * plane + here)
                     + d[7] * LOAD(0, horizon + sheets[2 * n + 1] * plane + here);
    const VEC facing = d[0] * LOAD(0, normal + here) + d[1] * LOAD(0, normal + plane + here)
                       + d[2] * LOAD(0, normal + 2 * plane + here);
    VEC c, s;
    turn(d[3] * x + d[4] * y + d[5] * LOAD(0, z + here), &c, &s);
    const IVEC seen = (facing > 0.0f) & (d[2] >= line * d[6]);
    STORE(select((VEC)(0.0f), c, seen), 0, out + n * plane + here);
    STORE(select((VEC)(0.0f), s, seen), 0, out + (count + n) * plane + here);
}
