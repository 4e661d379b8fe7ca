// Direct sum S(q) = sum_j w_j exp(-i q . r_j) in single precision with phases that keep their fraction of a cycle.
//
// Coordinates and q / (2 pi) come as pairs of floats (high + low part). The high product is exact as hi + err (fused
// multiply-add), its whole turns drop out exactly, and only then single precision adds up. WIDTH floats at a time:
// CPU compilers do not vectorise a loop over points by themselves.
//
// Host defines: WIDTH (4, 8, 16), BLOCK (points of one work-item, a multiple of WIDTH).

#define JOIN2(a, b) a##b
#define JOIN(a, b) JOIN2(a, b)
#define VEC JOIN(float, WIDTH)
#define LOAD JOIN(vload, WIDTH)

inline VEC turns(const float qh, const float ql, const VEC ph, const VEC pl)
{
    const VEC hi = qh * ph;
    const VEC err = fma((VEC)(qh), ph, -hi);
    return (hi - rint(hi)) + (err + fma((VEC)(qh), pl, ql * ph));
}

__kernel void direct_sum(
    const int targets,
    const int blocks,
    __global const float *restrict q,      // (targets, 6): x, y, z high, then low, in turns per micrometre
    __global const float *restrict xh, __global const float *restrict xl,
    __global const float *restrict yh, __global const float *restrict yl,
    __global const float *restrict zh, __global const float *restrict zl,
    __global const float *restrict weight,
    __global double *restrict partial)     // (blocks, targets, 2)
{
    const int m = get_global_id(0);
    const int b = get_global_id(1);
    if (m >= targets || b >= blocks)
        return;
    const float qxh = q[6 * m], qyh = q[6 * m + 1], qzh = q[6 * m + 2];
    const float qxl = q[6 * m + 3], qyl = q[6 * m + 4], qzl = q[6 * m + 5];
    VEC re = (VEC)(0.0f), im = (VEC)(0.0f);
    for (int j = b * (BLOCK / WIDTH); j < (b + 1) * (BLOCK / WIDTH); ++j) {
        VEC t = turns(qxh, qxl, LOAD(j, xh), LOAD(j, xl)) + turns(qyh, qyl, LOAD(j, yh), LOAD(j, yl))
              + turns(qzh, qzl, LOAD(j, zh), LOAD(j, zl));
        const VEC half_turns = rint(2.0f * t);
        t = fma((VEC)(-0.5f), half_turns, t);                    // now within a quarter turn
        const VEC a = 6.283185307179586f * t;
        const VEC s2 = a * a;
        VEC c = fma(s2, (VEC)(2.08767570e-9f), (VEC)(-2.75573192e-7f));  // Taylor series, error below 1e-8 here
        c = fma(s2, c, (VEC)(2.48015873e-5f));
        c = fma(s2, c, (VEC)(-1.38888889e-3f));
        c = fma(s2, c, (VEC)(4.16666667e-2f));
        c = fma(s2, c, (VEC)(-0.5f));
        c = fma(s2, c, (VEC)(1.0f));
        VEC s = fma(s2, (VEC)(-2.50521084e-8f), (VEC)(2.75573192e-6f));
        s = fma(s2, s, (VEC)(-1.98412698e-4f));
        s = fma(s2, s, (VEC)(8.33333333e-3f));
        s = fma(s2, s, (VEC)(-1.66666667e-1f));
        s = fma(s2 * a, s, a);
        // odd numbers of half turns change the sign of both
        const VEC odd = half_turns - 2.0f * floor(0.5f * half_turns);
        const VEC w = LOAD(j, weight) * (1.0f - 2.0f * odd);
        re = fma(w, c, re);
        im = fma(-w, s, im);
    }
    float r[WIDTH], i[WIDTH];
    JOIN(vstore, WIDTH)(re, 0, r);
    JOIN(vstore, WIDTH)(im, 0, i);
    double sr = 0.0, si = 0.0;
    for (int v = 0; v < WIDTH; ++v) {
        sr += r[v];
        si += i[v];
    }
    partial[2 * ((size_t)b * targets + m)] = sr;
    partial[2 * ((size_t)b * targets + m) + 1] = si;
}
