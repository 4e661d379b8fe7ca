// Direct sum S(q) = sum_j w_j exp(-i q . r_j) in single precision with phases that keep their fraction of a cycle.
//
// The points lie on a grid: a row has one y and the columns have one x each. Coordinates and q / (2 pi) come as pairs of
// floats (high + low part). The high product is exact as p + err (fused multiply-add), its whole turns drop out exactly,
// and only then single precision adds up. The turns of x are found once for all rows of a work-item's strip of columns.
// WIDTH floats at a time: CPU compilers do not vectorise a loop over points by themselves.
//
// Host defines: WIDTH (4, 8, 16), COLUMNS (points of one row of a work-item, a multiple of WIDTH).

#define JOIN2(a, b) a##b
#define JOIN(a, b) JOIN2(a, b)
#define VEC JOIN(float, WIDTH)
#define LOAD JOIN(vload, WIDTH)
#define STEPS (COLUMNS / WIDTH)

// Nearest whole number for |t| < 2^22: adding and taking away 1.5 * 2^23 (rint is not a vector instruction everywhere).
#define WHOLE(t) (((t) + 12582912.0f) - 12582912.0f)

inline VEC turns(const float qh, const float ql, const VEC ph, const VEC pl)
{
    const VEC p = qh * ph;
    const VEC err = fma((VEC)(ql), ph, fma((VEC)(qh), pl, fma((VEC)(qh), ph, -p)));
    return (p - WHOLE(p)) + err;
}

__kernel void direct_sum(
    const int targets,
    const int rows, const int strips, const int width,       // width: of a padded row, strips * COLUMNS
    const int rows_at_once,
    __global const float *restrict q,      // (targets, 6): x, y, z high, then low, in turns per micrometre
    __global const float *restrict xh, __global const float *restrict xl,   // (width)
    __global const float *restrict yh, __global const float *restrict yl,   // (rows)
    __global const float *restrict zh, __global const float *restrict zl,   // (rows, width)
    __global const float *restrict weight,
    __global double *restrict partial)     // (groups of rows * strips, targets, 2)
{
    const int m = get_global_id(0);
    const int b = get_global_id(1);
    if (m >= targets)
        return;
    const int strip = b % strips, first = b / strips * rows_at_once, last = min(first + rows_at_once, rows);
    const float qxh = q[6 * m], qyh = q[6 * m + 1], qzh = q[6 * m + 2];
    const float qxl = q[6 * m + 3], qyl = q[6 * m + 4], qzl = q[6 * m + 5];
    VEC along[STEPS];
    for (int j = 0; j < STEPS; ++j)
        along[j] = turns(qxh, qxl, LOAD(strip * STEPS + j, xh), LOAD(strip * STEPS + j, xl));
    double sr = 0.0, si = 0.0;
    for (int r = first; r < last; ++r) {
        const float py = qyh * yh[r];
        const float ty = (py - WHOLE(py)) + fma(qyl, yh[r], fma(qyh, yl[r], fma(qyh, yh[r], -py)));
        VEC re = (VEC)(0.0f), im = (VEC)(0.0f);
        const int start = (r * width + strip * COLUMNS) / WIDTH;
        for (int j = 0; j < STEPS; ++j) {
            VEC t = along[j] + (turns(qzh, qzl, LOAD(start + j, zh), LOAD(start + j, zl)) + ty);
            t -= WHOLE(t);                                   // within half a turn
            const VEC h = 3.14159265358979f * t;             // half the angle, within a quarter turn
            const VEC s2 = h * h;
            VEC c = fma(s2, (VEC)(-2.607710504e-7f), (VEC)(2.476188623e-5f));  // minimax, error below 1e-9
            c = fma(s2, c, (VEC)(-1.388840351e-3f));
            c = fma(s2, c, (VEC)(4.166664073e-2f));
            c = fma(s2, c, (VEC)(-4.999999955e-1f));
            c = fma(s2, c, (VEC)(1.0f));
            VEC s = fma(s2, (VEC)(2.600054702e-6f), (VEC)(-1.980661517e-4f));  // minimax, error below 5e-9
            s = fma(s2, s, (VEC)(8.333017291e-3f));
            s = fma(s2, s, (VEC)(-1.66666571e-1f));
            s = fma(s2 * h, s, h);
            const VEC ws = LOAD(start + j, weight) * s;
            re = fma(ws, s, re);                             // w sin^2: w cos(2h) = w - 2 w sin^2
            im = fma(ws, c, im);                             // w sin cos: half of w sin(2h)
        }
        float a[WIDTH], e[WIDTH];
        JOIN(vstore, WIDTH)(re, 0, a);
        JOIN(vstore, WIDTH)(im, 0, e);
        float ra = 0.0f, ia = 0.0f;
        for (int v = 0; v < WIDTH; ++v) {
            ra += a[v];
            ia += e[v];
        }
        sr += ra;
        si += ia;
    }
    partial[2 * ((size_t)b * targets + m)] = sr;             // the host takes twice this off the sum of the weights
    partial[2 * ((size_t)b * targets + m) + 1] = -2.0 * si;
}
