// What kernels of patches share, put before each of them. Host defines: WIDTH.

#define JOIN2(a, b) a##b
#define JOIN(a, b) JOIN2(a, b)
#define VEC JOIN(float, WIDTH)
#define IVEC JOIN(int, WIDTH)
#define LOAD JOIN(vload, WIDTH)
#define STORE JOIN(vstore, WIDTH)
#define LOWEST -1.0e30f

#if WIDTH == 16
#define LANES ((uchar16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15))
#define BITS ((uchar16)(1, 2, 4, 8, 16, 32, 64, 128, 1, 2, 4, 8, 16, 32, 64, 128))
#else
#define LANES ((uchar8)(0, 1, 2, 3, 4, 5, 6, 7))
#define BITS ((uchar8)(1, 2, 4, 8, 16, 32, 64, 128))
#endif

#define TURN(NAME, T)                                                                                  \
inline void NAME(const T turns, T *c, T *s)   /* cos and sin of 2 pi turns */                          \
{                                                                                                      \
    T t = turns - rint(turns);                                                                         \
    const T half_turns = rint(2.0f * t);                                                               \
    t = fma((T)(-0.5f), half_turns, t);       /* now within a quarter turn */                          \
    const T a = 6.283185307179586f * t;                                                                \
    const T s2 = a * a;                                                                                \
    T x = fma(s2, (T)(2.08767570e-9f), (T)(-2.75573192e-7f));                                          \
    x = fma(s2, x, (T)(2.48015873e-5f));                                                               \
    x = fma(s2, x, (T)(-1.38888889e-3f));                                                              \
    x = fma(s2, x, (T)(4.16666667e-2f));                                                               \
    x = fma(s2, x, (T)(-0.5f));                                                                        \
    x = fma(s2, x, (T)(1.0f));                                                                         \
    T y = fma(s2, (T)(-2.50521084e-8f), (T)(2.75573192e-6f));                                          \
    y = fma(s2, y, (T)(-1.98412698e-4f));                                                              \
    y = fma(s2, y, (T)(8.33333333e-3f));                                                               \
    y = fma(s2, y, (T)(-1.66666667e-1f));                                                              \
    y = fma(s2 * a, y, a);                                                                             \
    const T sign = 1.0f - 2.0f * fabs(half_turns - 2.0f * rint(0.5f * half_turns));                    \
    *c = x * sign;                                                                                     \
    *s = y * sign;                                                                                     \
}
TURN(turn, VEC)

