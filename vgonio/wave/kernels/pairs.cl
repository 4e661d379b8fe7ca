// One more reflection on a height field: from every visible point to every observer, vector fields, tangent plane.
//
// WIDTH observers beside each other along x look at one and the same offset (dx, dy) at a time, so that distances are
// uniform but for the heights and sources load as vectors. Sight: the horizon of an observer grows outward column by
// column (Franklin and Ray 1994, XDraw): the line to a cell crosses the column before between two cells, whose
// horizons are interpolated. Nothing is kept of the pairs but one column of horizons.
//
// Fields are A = N x E and B = N x H, three complex components each, area included. A source sends to an observer the
// wave E = ik' G u x (A - u x B) along u, G = exp(ik d)/(4 pi d), k' = k (1 + i/kd); with s = u x n/|u x n|, p = u x s
// its components are E_s = ik'G (B.s - A.p), E_p = ik'G (A.s + B.p), and the tangent plane makes
//   n x E = (1 - r_p) c E_p s + (1 + r_s) E_s t,   n x H = (1 - r_s) c E_s s - (1 + r_p) E_p t,   t = n x s.
//
// For penetrable media the part of E_p that comes from B is received with Q in place of r_p (Sommerfeld; see
// propagate.near_grazing), Q = r_p + (1 - r_p) F(w) metal, F(w) = 1 + i sqrt(pi) w W(w), W the Faddeeva function, w =
// sqrt(i k d / 2) (c + beta), beta = (1 - r_p) c/(1 + r_p). W by Weideman's (1994) rational series.
//
// Host defines: WIDTH, SIDES (number of incident fields), MOST (cells along the longer side, at least), PERFECT; FADDEEVA (coefficients, highest power first), TERMS, SCALE.

#define JOIN2(a, b) a##b
#define JOIN(a, b) JOIN2(a, b)
#define VEC JOIN(float, WIDTH)
#define IVEC JOIN(int, WIDTH)
#define LOAD JOIN(vload, WIDTH)
#define STORE JOIN(vstore, WIDTH)
#define LOWEST -1.0e30f

typedef struct {
    VEC z, nx, ny, nz;
} Point;

inline void turn(const VEC turns, VEC *c, VEC *s)   // cos and sin of 2 pi turns
{
    VEC t = turns - rint(turns);
    const VEC half_turns = rint(2.0f * t);
    t = fma((VEC)(-0.5f), half_turns, t);            // now within a quarter turn
    const VEC a = 6.283185307179586f * t;
    const VEC s2 = a * a;
    VEC x = fma(s2, (VEC)(2.08767570e-9f), (VEC)(-2.75573192e-7f));
    x = fma(s2, x, (VEC)(2.48015873e-5f));
    x = fma(s2, x, (VEC)(-1.38888889e-3f));
    x = fma(s2, x, (VEC)(4.16666667e-2f));
    x = fma(s2, x, (VEC)(-0.5f));
    x = fma(s2, x, (VEC)(1.0f));
    VEC y = fma(s2, (VEC)(-2.50521084e-8f), (VEC)(2.75573192e-6f));
    y = fma(s2, y, (VEC)(-1.98412698e-4f));
    y = fma(s2, y, (VEC)(8.33333333e-3f));
    y = fma(s2, y, (VEC)(-1.66666667e-1f));
    y = fma(s2 * a, y, a);
    const VEC sign = 1.0f - 2.0f * fabs(half_turns - 2.0f * rint(0.5f * half_turns));
    *c = x * sign;
    *s = y * sign;
}

#ifndef PERFECT
// r = (a - b)/(a + b), complex
inline void quotient(const VEC ar, const VEC ai, const VEC br, const VEC bi, VEC *re, VEC *im)
{
    const VEC nr = ar - br, ni = ai - bi, dr = ar + br, di = ai + bi;
    const VEC inverse = 1.0f / (dr * dr + di * di);
    *re = (nr * dr + ni * di) * inverse;
    *im = (ni * dr - nr * di) * inverse;
}

__constant float series[TERMS] = {FADDEEVA};

// Faddeeva's function of x + iy, y >= 0
inline void faddeeva(const VEC x, const VEC y, VEC *re, VEC *im)
{
    // (SCALE + iz)/(SCALE - iz)
    const VEC dr = SCALE + y, di = -x, nr = SCALE - y, ni = x;
    const VEC inverse = 1.0f / (dr * dr + di * di);
    const VEC zr = (nr * dr + ni * di) * inverse, zi = (ni * dr - nr * di) * inverse;
    VEC pr = (VEC)(series[0]), pi = (VEC)(0.0f);
    for (int n = 1; n < TERMS; ++n) {
        const VEC t = pr * zr - pi * zi + series[n];
        pi = pr * zi + pi * zr;
        pr = t;
    }
    const VEC qr = dr * inverse, qi = -di * inverse;     // 1/(SCALE - iz)
    const VEC sr = 2.0f * (pr * qr - pi * qi) + 0.5641895835f, si = 2.0f * (pr * qi + pi * qr);
    *re = sr * qr - si * qi;
    *im = sr * qi + si * qr;
}

// F(w), Re w >= 0
inline void sommerfeld(const VEC x, const VEC y, VEC *re, VEC *im)
{
    VEC fr, fi;
    const IVEC below = y < 0.0f;
    faddeeva(select(x, -x, below), fabs(y), &fr, &fi);
    if (any(below)) {                                     // W(w) = 2 exp(-w^2) - W(-w)
        const VEC size = 2.0f * exp(y * y - x * x), angle = -2.0f * x * y;
        fr = select(fr, size * cos(angle) - fr, below);
        fi = select(fi, size * sin(angle) - fi, below);
    }
    // 1 + i sqrt(pi) w W
    *re = 1.0f - 1.7724538509f * (x * fi + y * fr);
    *im = 1.7724538509f * (x * fr - y * fi);
}
#endif

// adds what one source column sends to the observers; index: of the first lane's source
inline void reflected(const Point o, const Point q, const float rx, const float ry, const IVEC seen, const int index,
                      const int plane, __global const float *restrict source, const float k, const float area,
                      const float er, const float ei, const float metal, VEC *acc)
{
    const VEC rz = o.z - q.z;
    const VEC inverse = rsqrt(rx * rx + ry * ry + rz * rz);
    const VEC ux = rx * inverse, uy = ry * inverse, uz = rz * inverse;
    const VEC leaving = ux * q.nx + uy * q.ny + uz * q.nz;
    VEC c = -(ux * o.nx + uy * o.ny + uz * o.nz);
    const IVEC pair = seen & (leaving > 1e-6f) & (c > 1e-6f);
    if (!any(pair))
        return;
    c = fmax(c, 1e-6f);                                   // lanes that are no pairs stay finite; their front is 0
    VEC co, si;
    turn((1.0f / inverse) * (k * 0.15915494309189535f), &co, &si);
    const VEC front = select((VEC)(0.0f), inverse * (area * 0.07957747154594767f), pair);
    const VEC gr = -front * (inverse * co + k * si), gi = front * (k * co - inverse * si);
    VEC sx = uy * o.nz - uz * o.ny, sy = uz * o.nx - ux * o.nz, sz = ux * o.ny - uy * o.nx;
    const VEC length = rsqrt(sx * sx + sy * sy + sz * sz + 1e-14f);
    sx *= length, sy *= length, sz *= length;
    const VEC px = uy * sz - uz * sy, py = uz * sx - ux * sz, pz = ux * sy - uy * sx;
    const VEC tx = o.ny * sz - o.nz * sy, ty = o.nz * sx - o.nx * sz, tz = o.nx * sy - o.ny * sx;
#ifndef PERFECT
    const VEC wr = er - 1.0f + c * c;                // root = sqrt(eps - 1 + c^2), imaginary part not negative
    const VEC size = sqrt(wr * wr + ei * ei);
    const VEC root_r = sqrt(max(0.5f * (size + wr), 0.0f)), root_i = sqrt(max(0.5f * (size - wr), 0.0f));
    VEC rs, is, rp, ip;
    quotient(c, (VEC)(0.0f), root_r, root_i, &rs, &is);
    quotient(er * c, ei * c, root_r, root_i, &rp, &ip);
    const float over = 1.0f / (er * er + ei * ei);
    const VEC br = (root_r * er + root_i * ei) * over, bi = (root_i * er - root_r * ei) * over;    // root/eps
    const VEC near = 0.5f * sqrt(k / inverse);            // sqrt(i k d/2) = (1 + i)/2 sqrt(k d)
    VEC wide_r, wide_i;
    sommerfeld(near * (c + br - bi), near * (c + br + bi), &wide_r, &wide_i);
    const VEC q_r = 1.0f + rp + metal * ((1.0f - rp) * wide_r + ip * wide_i);
    const VEC q_i = ip + metal * ((1.0f - rp) * wide_i - ip * wide_r);
#endif
    for (int n = 0; n < SIDES; ++n) {
        __global const float *f = source + (size_t)n * 12 * plane;
        VEC v[12];
        for (int i = 0; i < 12; ++i)
            v[i] = LOAD(0, f + (size_t)i * plane + index);
        // v: A_x re, im, A_y, A_z, B_x, B_y, B_z
        const VEC asr = v[0] * sx + v[2] * sy + v[4] * sz, asi = v[1] * sx + v[3] * sy + v[5] * sz;
        const VEC apr = v[0] * px + v[2] * py + v[4] * pz, api = v[1] * px + v[3] * py + v[5] * pz;
        const VEC bsr = v[6] * sx + v[8] * sy + v[10] * sz, bsi = v[7] * sx + v[9] * sy + v[11] * sz;
        const VEC bpr = v[6] * px + v[8] * py + v[10] * pz, bpi = v[7] * px + v[9] * py + v[11] * pz;
        const VEC fr = bsr - apr, fi = bsi - api, hr = asr + bpr, hi = asi + bpi;
        const VEC Er = gr * fr - gi * fi, Ei = gr * fi + gi * fr;      // s
        const VEC Pr = gr * hr - gi * hi, Pi = gr * hi + gi * hr;      // p
        VEC *a = acc + 12 * n;
#ifdef PERFECT
        const VEC mr = 2.0f * c * Er, mi = 2.0f * c * Ei, wr2 = -2.0f * Pr, wi2 = -2.0f * Pi;
#else
        const VEC dr = gr * bpr - gi * bpi, di = gr * bpi + gi * bpr, ar = Pr - dr, ai = Pi - di;
        const VEC xr = q_r * dr - q_i * di + (1.0f + rp) * ar - ip * ai;
        const VEC xi = q_r * di + q_i * dr + (1.0f + rp) * ai + ip * ar;
        const VEC lr = br * xr - bi * xi, li = br * xi + bi * xr;
        const VEC qr = (1.0f + rs) * Er - is * Ei, qi = (1.0f + rs) * Ei + is * Er;
        const VEC mr = c * ((1.0f - rs) * Er + is * Ei), mi = c * ((1.0f - rs) * Ei - is * Er);
        const VEC wr2 = -xr, wi2 = -xi;
        a[0] += lr * sx + qr * tx, a[1] += li * sx + qi * tx;
        a[2] += lr * sy + qr * ty, a[3] += li * sy + qi * ty;
        a[4] += lr * sz + qr * tz, a[5] += li * sz + qi * tz;
#endif
        a[6] += mr * sx + wr2 * tx, a[7] += mi * sx + wi2 * tx;
        a[8] += mr * sy + wr2 * ty, a[9] += mi * sy + wi2 * ty;
        a[10] += mr * sz + wr2 * tz, a[11] += mi * sz + wi2 * tz;
    }
}

__kernel void pairs(
    const int columns, const int rows, const int stride, const int left,   // stride: padded columns, left: padding
    const int first,                                                       // row of the first work-item
    const float pitch, const float k, const float er, const float ei, const float metal, const float highest,
    __global const float *restrict z,                                      // (rows, stride), far below in the padding
    __global const float *restrict normal,                                 // (3, rows, stride)
    __global const float *restrict source,                                 // (SIDES, 12, rows, stride)
    __global float *restrict out)                                          // the same, what arrives
{
    const int ix = get_global_id(0) * WIDTH;
    const int iy = first + get_global_id(1);
    const int plane = rows * stride;
    if (ix >= columns || iy >= rows)
        return;
    const int here = iy * stride + left + ix;
    Point o;
    o.z = LOAD(0, z + here);
    o.nx = LOAD(0, normal + here), o.ny = LOAD(0, normal + plane + here), o.nz = LOAD(0, normal + 2 * plane + here);
    const IVEC inside = o.z > -1.0e5f;                 // lanes beyond the last column see nothing
    VEC acc[12 * SIDES];
    for (int i = 0; i < 12 * SIDES; ++i)
        acc[i] = (VEC)(0.0f);
    VEC horizon[2 * MOST + 1];
    for (int wedge = 0; wedge < 4; ++wedge) {
        const int along_x = wedge < 2, sign = (wedge & 1) ? -1 : 1;
        // cells along the axis of the wedge, for the lane that is farthest from that end
        const int reach = along_x ? (sign > 0 ? columns - 1 - ix : min(ix + WIDTH, columns) - 1)
                                  : (sign > 0 ? rows - 1 - iy : iy);
        for (int i = 0; i < 2 * MOST + 1; ++i)
            horizon[i] = (VEC)(LOWEST);
        for (int a = 1; a <= reach; ++a) {
            const int least = along_x ? max(-a, -iy) : max(-a, -(ix + WIDTH - 1));
            const int most = along_x ? min(a, rows - 1 - iy) : min(a, columns - 1 - ix);
            IVEC open = (IVEC)(0);
            for (int end = 0; end < 2; ++end)       // from the outer end inward, so that the column before is intact
            for (int b = end ? most : least; end ? b >= 0 : b < 0; b += end ? -1 : 1) {
                const float share = fabs((float)b) / a;
                const int inner = b == 0 ? 0 : (b > 0 ? b - 1 : b + 1);
                VEC line;
                if (a == 1)
                    line = (VEC)(LOWEST);
                else if (abs(b) == a)
                    line = horizon[MOST + inner];       // the diagonal crosses the column before at its own end
                else
                    line = horizon[MOST + b] * (1.0f - share) + horizon[MOST + inner] * share;
                const float dx = pitch * (along_x ? sign * a : b), dy = pitch * (along_x ? b : sign * a);
                const float flat = rsqrt(dx * dx + dy * dy);
                const int index = here + (along_x ? sign * a + b * stride : b + sign * a * stride);
                Point q;
                q.z = LOAD(0, z + index);
                const VEC rise = (q.z - o.z) * flat;
                const IVEC seen = (rise >= line) & inside;
                horizon[MOST + b] = fmax(line, rise);
                open |= ((highest - o.z) * flat >= line) & inside;
                if ((along_x || abs(b) < a) && any(seen)) {
                    q.nx = LOAD(0, normal + index);
                    q.ny = LOAD(0, normal + plane + index);
                    q.nz = LOAD(0, normal + 2 * plane + index);
                    reflected(o, q, -dx, -dy, seen, index, plane, source, k, pitch * pitch, er, ei, metal, acc);
                }
            }
            if (!any(open))
                break;
        }
    }
    for (int i = 0; i < 12 * SIDES; ++i)
        STORE(acc[i], 0, out + (size_t)i * plane + here);
}

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
    float top = LOWEST;
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
