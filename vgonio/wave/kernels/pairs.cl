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


#define BYTES JOIN(uchar, WIDTH)
#define as_bytes JOIN(as_uchar, WIDTH)
#define as_signed JOIN(as_char, WIDTH)
#define convert_signed JOIN(convert_char, WIDTH)
#define convert_mask JOIN(convert_int, WIDTH)
#define convert_lanes JOIN(convert_float, WIDTH)
#define EIGHTS ((float8)(0, 1, 2, 3, 4, 5, 6, 7))
#define GUARD 4                     // cells beyond the last that may be seen whose horizons are kept up to date
#ifdef PERFECT
#define PARTS 6                     // of a field: N x H alone
#else
#define PARTS 12
#endif

typedef struct {
    VEC z, nx, ny, nz;
} Point;

TURN(turn8, float8)

inline float total(const float8 v)
{
    const float4 h = v.lo + v.hi;
    return h.x + h.y + h.z + h.w;
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

// what depends on the pair alone: the wave's front, the axes s, p, t and the reflection coefficients of the observer
typedef struct {
    VEC gr, gi, c, sx, sy, sz, px, py, pz, tx, ty, tz;
#ifndef PERFECT
    VEC rs, is, rp, ip, qr, qi, br, bi;
#endif
} Wave;

inline Wave wave(const Point o, const VEC ux, const VEC uy, const VEC uz, const VEC inverse, const VEC cosine,
                 const IVEC pair, const float k, const float area, const float er, const float ei, const float metal)
{
    Wave w;
    w.c = fmax(cosine, 1e-6f);                            // lanes that are no pairs stay finite; their front is 0
    VEC co, si;
    turn((1.0f / inverse) * (k * 0.15915494309189535f), &co, &si);
    const VEC front = select((VEC)(0.0f), inverse * (area * 0.07957747154594767f), pair);
    w.gr = -front * (inverse * co + k * si), w.gi = front * (k * co - inverse * si);
    w.sx = uy * o.nz - uz * o.ny, w.sy = uz * o.nx - ux * o.nz, w.sz = ux * o.ny - uy * o.nx;
    const VEC length = rsqrt(w.sx * w.sx + w.sy * w.sy + w.sz * w.sz + 1e-14f);
    w.sx *= length, w.sy *= length, w.sz *= length;
    w.px = uy * w.sz - uz * w.sy, w.py = uz * w.sx - ux * w.sz, w.pz = ux * w.sy - uy * w.sx;
    w.tx = o.ny * w.sz - o.nz * w.sy, w.ty = o.nz * w.sx - o.nx * w.sz, w.tz = o.nx * w.sy - o.ny * w.sx;
#ifndef PERFECT
    const VEC wr = er - 1.0f + w.c * w.c;            // root = sqrt(eps - 1 + c^2), imaginary part not negative
    const VEC size = sqrt(wr * wr + ei * ei);
    const VEC root_r = sqrt(max(0.5f * (size + wr), 0.0f)), root_i = sqrt(max(0.5f * (size - wr), 0.0f));
    quotient(w.c, (VEC)(0.0f), root_r, root_i, &w.rs, &w.is);
    quotient(er * w.c, ei * w.c, root_r, root_i, &w.rp, &w.ip);
    const float over = 1.0f / (er * er + ei * ei);
    w.br = (root_r * er + root_i * ei) * over, w.bi = (root_i * er - root_r * ei) * over;    // root/eps
    const VEC near = 0.5f * sqrt(k / inverse);            // sqrt(i k d/2) = (1 + i)/2 sqrt(k d)
    VEC wide_r, wide_i;
    sommerfeld(near * (w.c + w.br - w.bi), near * (w.c + w.br + w.bi), &wide_r, &wide_i);
    w.qr = 1.0f + w.rp + metal * ((1.0f - w.rp) * wide_r + w.ip * wide_i);
    w.qi = w.ip + metal * ((1.0f - w.rp) * wide_i - w.ip * wide_r);
#endif
    return w;
}

// adds to acc[PARTS] the reflection of the wave that fields v[PARTS] of one incident polarisation send
inline void reflected(const Wave *w, const VEC *v, VEC *acc)
{
    const VEC *B = v + PARTS - 6, gr = w->gr, gi = w->gi;
    VEC *m = acc + PARTS - 6;
    const VEC bsr = B[0] * w->sx + B[2] * w->sy + B[4] * w->sz, bsi = B[1] * w->sx + B[3] * w->sy + B[5] * w->sz;
    const VEC bpr = B[0] * w->px + B[2] * w->py + B[4] * w->pz, bpi = B[1] * w->px + B[3] * w->py + B[5] * w->pz;
#ifdef PERFECT                                            // N x E = 0
    const VEC mr = 2.0f * w->c * (gr * bsr - gi * bsi), mi = 2.0f * w->c * (gr * bsi + gi * bsr);
    const VEC nr = -2.0f * (gr * bpr - gi * bpi), ni = -2.0f * (gr * bpi + gi * bpr);
#else
    const VEC asr = v[0] * w->sx + v[2] * w->sy + v[4] * w->sz, asi = v[1] * w->sx + v[3] * w->sy + v[5] * w->sz;
    const VEC apr = v[0] * w->px + v[2] * w->py + v[4] * w->pz, api = v[1] * w->px + v[3] * w->py + v[5] * w->pz;
    const VEC fr = bsr - apr, fi = bsi - api;
    const VEC Er = gr * fr - gi * fi, Ei = gr * fi + gi * fr;      // s
    const VEC dr = gr * bpr - gi * bpi, di = gr * bpi + gi * bpr, ar = gr * asr - gi * asi, ai = gr * asi + gi * asr;
    const VEC xr = w->qr * dr - w->qi * di + (1.0f + w->rp) * ar - w->ip * ai;
    const VEC xi = w->qr * di + w->qi * dr + (1.0f + w->rp) * ai + w->ip * ar;
    const VEC lr = w->br * xr - w->bi * xi, li = w->br * xi + w->bi * xr;
    const VEC yr = (1.0f + w->rs) * Er - w->is * Ei, yi = (1.0f + w->rs) * Ei + w->is * Er;
    const VEC mr = w->c * ((1.0f - w->rs) * Er + w->is * Ei), mi = w->c * ((1.0f - w->rs) * Ei - w->is * Er);
    const VEC nr = -xr, ni = -xi;
    acc[0] += lr * w->sx + yr * w->tx, acc[1] += li * w->sx + yi * w->tx;
    acc[2] += lr * w->sy + yr * w->ty, acc[3] += li * w->sy + yi * w->ty;
    acc[4] += lr * w->sz + yr * w->tz, acc[5] += li * w->sz + yi * w->tz;
#endif
    m[0] += mr * w->sx + nr * w->tx, m[1] += mi * w->sx + ni * w->tx;
    m[2] += mr * w->sy + nr * w->ty, m[3] += mi * w->sy + ni * w->ty;
    m[4] += mr * w->sz + nr * w->tz, m[5] += mi * w->sz + ni * w->tz;
}

inline Point point(__global const float *restrict z, __global const float *restrict normal, const int plane,
                   const int index)
{
    Point p;
    p.z = LOAD(0, z + index);
    p.nx = LOAD(0, normal + index);
    p.ny = LOAD(0, normal + plane + index);
    p.nz = LOAD(0, normal + 2 * plane + index);
    return p;
}

// whether any lane is true (those are -1); quicker than `any` where that looks at one lane after the other
inline int some(const IVEC lanes)
{
#if WIDTH == 16
    const int8 a = lanes.lo | lanes.hi;
#else
    const int8 a = lanes;
#endif
    const ulong2 b = as_ulong2(a.lo | a.hi);
    return (b.x | b.y) != 0;
}

// lanes as bits: bytes that hold one bit each are added by the multiplication
inline uint packed(const IVEC lanes)
{
    const BYTES bits = as_bytes(convert_signed(lanes)) & BITS;
#if WIDTH == 16
    const ulong2 words = as_ulong2(bits) * 0x0101010101010101UL;
    return (uint)(words.x >> 56) | (uint)(words.y >> 56) << 8;
#else
    return (uint)((as_ulong(bits) * 0x0101010101010101UL) >> 56);
#endif
}

// 255 for lanes whose source lies in the i-th block from that of lane 0, whose column is `shift` within its block
inline void lanes_of_blocks(BYTES parts[BLOCK][WIDTH / BLOCK + 1])
{
    for (int shift = 0; shift < BLOCK; ++shift)
        for (int i = 0; i <= WIDTH / BLOCK; ++i)
            parts[shift][i] = as_bytes((LANES + (uchar)shift) / (uchar)BLOCK == (BYTES)(i));
}

// Lists the sources (offset along x, y, lanes) that send light to WIDTH observers; returns how many. With `count`, adds
// to `whole` how many points of each block do so.
inline int view(const Point o, const int ix, const int iy, const int columns, const int rows, const int stride,
                const int left, const int across, const int count, const float pitch, const float highest,
                __global const float *restrict z, __global const float *restrict normal,
                __global BYTES *restrict whole, __global uint *restrict list)
{
    const int plane = rows * stride, here = iy * stride + left + ix;
    VEC horizon[2 * MOST + 1];
    const VEC start = select((VEC)(LOWEST), (VEC)(-LOWEST), o.z < -1.0e5f);   // lanes beyond the last column see nothing
    BYTES parts[BLOCK][WIDTH / BLOCK + 1];
    lanes_of_blocks(parts);
    int found = 0;
    for (int wedge = 0; wedge < 4; ++wedge) {
        const int along_x = wedge < 2, sign = (wedge & 1) ? -1 : 1;
        // cells along the axis of the wedge, for the lane that is farthest from that end
        const int reach = along_x ? (sign > 0 ? columns - 1 - ix : min(ix + WIDTH, columns) - 1)
                                  : (sign > 0 ? rows - 1 - iy : iy);
        for (int i = MOST - reach; i <= MOST + reach; ++i)
            horizon[i] = start;
        int ends[2] = {1, 1};                       // how far out something may still be seen, towards -b and +b
        for (int a = 1; a <= reach; ++a) {
            const int most[2] = {min(a, along_x ? iy : ix + WIDTH - 1),
                                 min(a, (along_x ? rows - 1 - iy : columns - 1 - ix))};
            const float inverse_a = 1.0f / a;
            const VEC top = (highest - o.z) * inverse_a;
            int open = 0;
            for (int end = 0; end < 2; ++end) {     // from the outer end inward, so that the column before is intact
                const int out = end ? 1 : -1, last = min(most[end], ends[end] + GUARD);
                int b = last, outermost = -1;
                VEC before = horizon[MOST + out * b];
                for (; b >= 1 - end; --b) {
                    // the diagonal crosses the column before at its own end
                    const float share = b == a ? 1.0f : b * inverse_a;
                    const VEC inner = horizon[MOST + out * max(b - 1, 0)];
                    const VEC line = before * (1.0f - share) + inner * share;
                    before = inner;
                    const int ox = along_x ? sign * a : out * b, oy = along_x ? out * b : sign * a;
                    const int index = here + ox + oy * stride;
                    const VEC qz = LOAD(0, z + index), rise = (qz - o.z) * inverse_a;
                    IVEC pair = rise >= line;
                    horizon[MOST + out * b] = fmax(line, rise);
                    if (outermost < 0 && some(top >= line))
                        outermost = b;
                    if (!some(pair) || (!along_x && b == a))
                        continue;
                    const Point q = point(z, normal, plane, index);
                    const VEC rz = o.z - q.z;
                    const float rx = -pitch * ox, ry = -pitch * oy;
                    const VEC least = 1e-6f * sqrt(rx * rx + ry * ry + rz * rz);
                    pair &= (rx * q.nx + ry * q.ny + rz * q.nz > least) & (rx * o.nx + ry * o.ny + rz * o.nz < -least);
                    if (!some(pair))
                        continue;
                    list[2 * found] = (uint)(ox & 0xffff) | (uint)oy << 16;
                    list[2 * found + 1] = packed(pair);
                    ++found;
                    if (count) {
                        const int column = left + ix + ox, block = (iy + oy) / BLOCK * across + column / BLOCK;
                        const BYTES one = as_bytes(convert_signed(pair));          // 255 = -1
                        for (int i = 0; i <= WIDTH / BLOCK; ++i)
                            whole[block + i] -= one & parts[column & (BLOCK - 1)][i];
                    }
                }
                ends[end] = max(outermost, 0) + 1;
                open |= outermost >= 0;
            }
            if (!open)
                break;
        }
    }
    return found;
}

// 255 where a block has sent light from all its points to a lane no nearer than `nearest`, otherwise 0
inline void judge(const int ix, const int iy, const int left, const int across, const int deep, const float pitch,
                  const float nearest, __global BYTES *restrict whole)
{
    for (int by = 0; by < deep; ++by)
        for (int bx = 0; bx < across; ++bx) {
            const float middle = 0.5f * (BLOCK - 1), y = by * BLOCK + middle - iy;
            const VEC x = bx * BLOCK + middle - left - ix - convert_lanes(LANES);
            const IVEC far = (x * x + y * y) * (pitch * pitch) >= nearest * nearest;
            __global BYTES *points = whole + by * across + bx;
            *points = as_bytes(*points == (BYTES)(BLOCK * BLOCK)) & as_bytes(convert_signed(far));
        }
}

// What arrives from every visible point; with `count`, but for blocks that are seen as a whole, which `whole` holds.
// Work-items are vectors of observers, row by row, from begin on.
__kernel void pairs(
    const int columns, const int rows, const int stride, const int left,   // stride: padded columns, left: padding
    const int first, const int across, const int deep,                     // row of whole[0]; blocks beside, behind
    const float pitch, const float k, const float er, const float ei, const float metal, const float highest,
    __global const float *restrict z,                                      // (rows, stride), far below in the padding
    __global const float *restrict normal,                                 // (3, rows, stride)
    __global const float *restrict source,                                 // (SIDES, PARTS, rows, stride)
    __global BYTES *restrict whole,                                        // (rows from first, vectors, blocks)
    const int count, const float nearest, const int begin,
    __global uint *restrict lists,                                         // (work-items, columns rows, 2)
    __global float *restrict out)                                          // as source: what arrives
{
    const int vectors = (columns + WIDTH - 1) / WIDTH, item = begin + get_global_id(0);
    const int ix = item % vectors * WIDTH, iy = item / vectors;
    if (iy >= rows)
        return;
    const int plane = rows * stride, here = iy * stride + left + ix;
    const Point o = point(z, normal, plane, here);
    const size_t blocks = across * deep;
    __global BYTES *own = whole + (count ? (item - (size_t)first * vectors) * blocks : 0);
    __global uint *list = lists + get_global_id(0) * (size_t)(columns + WIDTH) * rows * 2;
    if (count)
        for (int i = 0; i < blocks; ++i)
            own[i] = (BYTES)(0);
    const int found = view(o, ix, iy, columns, rows, stride, left, across, count, pitch, highest, z, normal, own, list);
    if (count)
        judge(ix, iy, left, across, deep, pitch, nearest, own);
    VEC acc[PARTS * SIDES];
    for (int i = 0; i < PARTS * SIDES; ++i)
        acc[i] = (VEC)(0.0f);
    BYTES parts[BLOCK][WIDTH / BLOCK + 1];
    lanes_of_blocks(parts);
    for (int n = 0; n < found; ++n) {
        const int ox = (short)(list[2 * n] & 0xffff), oy = (int)list[2 * n] >> 16, index = here + ox + oy * stride;
        IVEC pair = ((IVEC)(list[2 * n + 1]) & ((IVEC)(1) << convert_mask(LANES))) != 0;
        if (count) {
            const int column = left + ix + ox, block = (iy + oy) / BLOCK * across + column / BLOCK;
            BYTES done = (BYTES)(0);
            for (int i = 0; i <= WIDTH / BLOCK; ++i)
                done |= own[block + i] & parts[column & (BLOCK - 1)][i];
            pair &= ~convert_mask(as_signed(done));
            if (!some(pair))
                continue;
        }
        const float rx = -pitch * ox, ry = -pitch * oy;
        const VEC rz = o.z - LOAD(0, z + index), inverse = rsqrt(rx * rx + ry * ry + rz * rz);
        const VEC ux = rx * inverse, uy = ry * inverse, uz = rz * inverse;
        const Wave w = wave(o, ux, uy, uz, inverse, -(ux * o.nx + uy * o.ny + uz * o.nz), pair, k, pitch * pitch, er, ei,
                            metal);
        for (int n = 0; n < SIDES; ++n) {
            VEC v[PARTS];
            for (int i = 0; i < PARTS; ++i)
                v[i] = LOAD(0, source + (size_t)(n * PARTS + i) * plane + index);
            reflected(&w, v, acc + PARTS * n);
        }
    }
    for (int i = 0; i < PARTS * SIDES; ++i)
        STORE(acc[i], 0, out + (size_t)i * plane + here);
}

// What arrives from blocks that are seen as a whole, at tiles of BLOCK x WIDTH observers. Towards a tile the sources of
// a block, without their phase along the line to its middle, are taken together at nodes, points of the same grid, by
// Lagrange's polynomials; nodes then send light like any point. Fewer nodes (`counts` along a side) do farther away
// than `distances`.
__kernel void thinned(
    const int columns, const int rows, const int stride, const int left, const int first, const int across,
    const int deep, const float pitch, const float k, const float er, const float ei, const float metal,
    __global const float *restrict z, __global const float *restrict normal, __global const float *restrict source,
    __global const BYTES *restrict whole,
    const int rules,                                 // of more and more nodes
    __global const float *restrict distances,        // (rules,) nearest
    __global const int *restrict nodes,              // (rules, 1 + BLOCK): how many, which
    __global const float *restrict polynomials,      // (rules, BLOCK, BLOCK): of a node at the points
    __global float *restrict out)
{
    const int ix = get_global_id(0) * WIDTH, top = get_global_id(1) * BLOCK, iy = first + top;
    const int vectors = get_global_size(0), plane = rows * stride, high = min(BLOCK, rows - iy);
    if (ix >= columns || high <= 0)
        return;
    const int mx = min(ix + WIDTH / 2, columns - 1), my = iy + high / 2;
    const float mz = z[my * stride + left + mx];
    VEC acc[BLOCK][PARTS * SIDES];
    Point o[BLOCK];
    for (int r = 0; r < high; ++r) {
        o[r] = point(z, normal, plane, (iy + r) * stride + left + ix);
        for (int i = 0; i < PARTS * SIDES; ++i)
            acc[r][i] = LOAD(0, out + (size_t)i * plane + (iy + r) * stride + left + ix);
    }
    const size_t of_row = (size_t)vectors * across * deep;
    const size_t own = top * of_row + (size_t)get_global_id(0) * across * deep;
    for (int by = 0; by < rows / BLOCK; ++by)
    for (int bx = 0; bx < across; ++bx) {
        BYTES any_lane = (BYTES)(0);
        for (int r = 0; r < high; ++r)
            any_lane |= whole[own + r * of_row + by * across + bx];
        if (!some(convert_mask(as_signed(any_lane))))
            continue;
        const int corner = by * BLOCK * stride + bx * BLOCK, middle = corner + BLOCK / 2 * (stride + 1);
        const float cx = pitch * (bx * BLOCK + BLOCK / 2 - left), cy = pitch * (by * BLOCK + BLOCK / 2), cz = z[middle];
        float dx = pitch * mx - cx, dy = pitch * my - cy, dz = mz - cz;
        const float distance = sqrt(dx * dx + dy * dy), turns = k * 0.15915494309189535f / sqrt(distance * distance + dz * dz);
        dx *= turns, dy *= turns, dz *= turns;       // now turns per length along the line
        int rule = 0;
        while (rule < rules - 1 && distance < distances[rule])
            ++rule;
        __global const int *which = nodes + rule * (1 + BLOCK);
        __global const float *weight = polynomials + rule * BLOCK * BLOCK;
        const int per = which[0];
        // along y first: (nodes, PARTS, points along x)
        float8 lines[BLOCK][PARTS * SIDES];
        for (int m = 0; m < per; ++m)
            for (int i = 0; i < PARTS * SIDES; ++i)
                lines[m][i] = (float8)(0.0f);
        for (int j = 0; j < BLOCK; ++j) {
            const int index = corner + j * stride;
            const float8 phase = dx * (pitch * (EIGHTS - BLOCK / 2)) + dy * pitch * (j - BLOCK / 2) + dz * (vload8(0, z + index) - cz);
            float8 co, si;
            turn8(phase, &co, &si);
            for (int i = 0; i < PARTS * SIDES; i += 2) {
                const float8 re = vload8(0, source + (size_t)i * plane + index), im = vload8(0, source + (size_t)(i + 1) * plane + index);
                const float8 fr = re * co + im * si, fi = im * co - re * si;
                for (int m = 0; m < per; ++m) {
                    lines[m][i] += weight[m * BLOCK + j] * fr;
                    lines[m][i + 1] += weight[m * BLOCK + j] * fi;
                }
            }
        }
        for (int n = 0; n < per; ++n) {
            const float8 across_x = vload8(n, weight);
            for (int m = 0; m < per; ++m) {
                const float nx = pitch * (bx * BLOCK + which[1 + n] - left), ny = pitch * (by * BLOCK + which[1 + m]);
                const float nz = z[corner + which[1 + m] * stride + which[1 + n]];
                const float phase = dx * (nx - cx) + dy * (ny - cy) + dz * (nz - cz);
                const float back = 6.283185307179586f * (phase - rint(phase)), co = cos(back), si = sin(back);
                float field[PARTS * SIDES];
                for (int i = 0; i < PARTS * SIDES; i += 2) {
                    const float re = total(lines[m][i] * across_x), im = total(lines[m][i + 1] * across_x);
                    field[i] = re * co - im * si, field[i + 1] = im * co + re * si;
                }
                for (int r = 0; r < high; ++r) {
                    const IVEC pair = convert_mask(as_signed(whole[own + r * of_row + by * across + bx]));
                    if (!some(pair))
                        continue;
                    const VEC rx = pitch * (ix + convert_lanes(LANES)) - nx, ry = (VEC)(pitch * (iy + r) - ny), rz = o[r].z - nz;
                    const VEC inverse = rsqrt(fmax(rx * rx + ry * ry + rz * rz, 1e-6f));
                    const VEC ux = rx * inverse, uy = ry * inverse, uz = rz * inverse;
                    const Wave w = wave(o[r], ux, uy, uz, inverse, -(ux * o[r].nx + uy * o[r].ny + uz * o[r].nz), pair, k,
                                        pitch * pitch, er, ei, metal);
                    for (int s = 0; s < SIDES; ++s) {
                        VEC v[PARTS];
                        for (int i = 0; i < PARTS; ++i)
                            v[i] = (VEC)(field[s * PARTS + i]);
                        reflected(&w, v, acc[r] + s * PARTS);
                    }
                }
            }
        }
    }
    for (int r = 0; r < high; ++r)
        for (int i = 0; i < PARTS * SIDES; ++i)
            STORE(acc[r][i], 0, out + (size_t)i * plane + (iy + r) * stride + left + ix);
}
