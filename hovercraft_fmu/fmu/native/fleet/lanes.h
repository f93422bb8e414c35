/* Plain drag, LANES craft side by side: the loops of kernel.c, operation by operation, so that each lane has its bits.
   Included once for each number of lanes and each instruction set; LANE(name) gives the names. What is rare is found
   after some sub-steps, and they are done again: a call for it in the loop costs a third. Lanes do not go from function
   to function but in line: on Windows a copy on the stack may be aligned too little. */

typedef double LANE(reals) __attribute__((vector_size(LANES * sizeof(double))));
typedef int64_t LANE(bits) __attribute__((vector_size(LANES * sizeof(int64_t))));
#define reals LANE(reals)
#define bits LANE(bits)

/* Rows of a block. */
struct LANE(motion) {
    reals x, y, heading, vx, vy, yaw_rate, fastest, left, right;
};
struct LANE(push) {
    reals x_d, drag, turning_drag, thrust, side, turn;
};
struct LANE(helm) {
    reals thrust, port, starboard, thrust_rate, port_rate, starboard_rate;
    reals thrust_min, thrust_max, steering_force, thruster_moment, per_mass, per_inertia;
};

static ALWAYS_INLINE void LANE(get)(double (*rows)[BLOCK], int n, int first, void *lanes)
{
    for (int k = 0; k < n; k++)
        memcpy((reals *)lanes + k, &rows[k][first], sizeof(reals));
}

static ALWAYS_INLINE void LANE(put)(double (*rows)[BLOCK], int n, int first, const void *lanes)
{
    for (int k = 0; k < n; k++)
        memcpy(&rows[k][first], (const reals *)lanes + k, sizeof(reals));
}

static ALWAYS_INLINE reals LANE(chosen)(bits which, reals a, reals b)
{
    return (reals)((which & (bits)a) | (~which & (bits)b));
}

static ALWAYS_INLINE reals LANE(size)(reals a)
{
    return (reals)((bits)a & ~SIGN);
}

static ALWAYS_INLINE reals LANE(largest)(reals a, reals b)
{
    return LANE(chosen)(b > a, b, a);
}

static ALWAYS_INLINE reals LANE(least)(reals a, reals b)
{
    return LANE(chosen)(b < a, b, a);
}

static ALWAYS_INLINE reals LANE(root)(reals a)
{
#if defined(__clang__) && __clang_major__ >= 18
    return __builtin_elementwise_sqrt(a);
#else
    for (int i = 0; i < LANES; i++)
        a[i] = square_root(a[i]);
    return a;
#endif
}

/* trig_sine_cosine of each lane; wrong for a rare angle, which is very close to a multiple of pi/2, as all large ones are
   for what is left of their digits: `margin` becomes negative. Of one up to pi/4 the quarters are 0. */
static ALWAYS_INLINE void LANE(sine_cosine)(reals angle, reals *sine, reals *cosine, reals *margin)
{
    const reals shifted = angle * TRIG_INVPIO2 + TRIG_TO_INTEGER; /* its last two bits are the quarters modulo 4 */
    const bits n = (bits)shifted;
    const reals quarters = shifted - TRIG_TO_INTEGER;
    const reals low = quarters * PIO2_1T, r = angle - quarters * PIO2_1, y = r - low, tail = (r - y) - low;
    reals s, c;
    TRIG_POLYNOMIALS(reals, y, tail, s, c);
    const bits swap = -(n & 1) & ((bits)s ^ (bits)c);
    *sine = (reals)((bits)s ^ swap ^ (n & 2) << 62);
    *cosine = (reals)((bits)c ^ swap ^ ((n + 1) & 2) << 62);
    *margin = LANE(least)(*margin, LANE(size)(y) - 0x1p-16 * LANE(size)(angle));
}

/* What the loads add to the velocities, and q. */
static ALWAYS_INLINE reals LANE(push)(const struct LANE(push) *f, reals heading, reals vx, reals vy, reals yaw_rate,
                                      reals *push_x, reals *push_y, reals *turn, reals *margin)
{
    reals c, s;
    LANE(sine_cosine)(heading, &s, &c, margin);
    const reals u = c * vx + s * vy;
    const reals w = c * vy - s * vx + yaw_rate * f->x_d;
    const reals q = LANE(root)(u * u + w * w);
    const reals ahead = f->thrust - f->drag * u * q;
    const reals abeam = f->side - f->drag * w * q;
    *turn = f->turn - f->turning_drag * w * q;
    *push_x = c * ahead - s * abeam;
    *push_y = s * ahead + c * abeam;
    return q;
}

static ALWAYS_INLINE reals LANE(clip)(reals value, reals low, reals high)
{
    return LANE(chosen)(value < low, low, LANE(chosen)(value > high, high, value));
}

/* Controls that vary, at a time [s] after the start. */
static ALWAYS_INLINE void LANE(steer)(struct block *block, int first, reals time, struct LANE(push) *f)
{
    if (block->varies) {
        struct LANE(helm) at;
        LANE(get)(block->helm, HELM, first, &at);
        const reals none = {0.0}, full = none + 1.0;
        const reals thrust = LANE(clip)(at.thrust + time * at.thrust_rate, at.thrust_min, at.thrust_max);
        const reals port = LANE(clip)(at.port + time * at.port_rate, none, full);
        const reals starboard = LANE(clip)(at.starboard + time * at.starboard_rate, none, full);
        f->thrust = thrust * at.per_mass;
        f->side = at.steering_force * (port - starboard) * at.per_mass;
        f->turn = at.thruster_moment * (port - starboard) * at.per_inertia;
    }
}

/* Sub-steps, for the lanes with a rare angle by the scalar kernel, from the state that is in the block. */
static ALWAYS_INLINE void LANE(mend)(struct block *block, int first, int64_t from, int64_t to,
                                     reals margin, struct LANE(motion) *z)
{
    const bits rare = margin < 0.0;
    unsigned which = 0;
    for (int lane = 0; lane < LANES; lane++)
        which |= rare[lane] ? 1u << (first + lane) : 0;
    if (which) {
        reals made[MOTION], mended[MOTION];
        memcpy(made, z, sizeof made);
        substeps_again(block, from, to, which);
        LANE(get)(block->motion, MOTION, first, mended);
        for (int k = 0; k < MOTION; k++)
            made[k] = LANE(chosen)(rare, mended[k], made[k]);
        memcpy(z, made, sizeof made);
    }
}

/* What was reached goes into the block; the loads there are watched, too. */
static ALWAYS_INLINE void LANE(finish)(struct block *block, int first, const struct LANE(push) *f,
                                       struct LANE(motion) *z)
{
    reals push_x, push_y, turn;
    struct LANE(motion) watched = *z;
    reals margin = {0.0};
    const reals q = LANE(push)(f, z->heading, z->vx, z->vy, z->yaw_rate, &push_x, &push_y, &turn, &margin);
    watched.fastest = LANE(largest)(z->fastest, q);
    LANE(put)(block->motion, MOTION, first, z);
    LANE(mend)(block, first, block->n, block->n, margin, &watched);
    LANE(put)(block->motion, MOTION, first, &watched);
}

/* Whether none is left within the range of numbers, seen as often as the kernel sees it. */
static ALWAYS_INLINE bool LANE(all_over)(const struct LANE(motion) *z, int64_t done)
{
    if ((done & (PIECE - 1)) != 0)
        return false;
    const reals none = {0.0};
    const bits finite = none * (z->x + z->y + z->heading + z->vx + z->vy + z->yaw_rate) == none;
    for (int lane = 0; lane < LANES; lane++)
        if (finite[lane])
            return false;
    return true;
}

static __attribute__((unused)) void LANE(semi_implicit_euler)(struct block *block, int first)
{
    struct LANE(push) f;
    struct LANE(motion) z;
    reals h, push_x, push_y, turn;
    LANE(get)(block->push, PUSH, first, &f);
    LANE(get)(block->motion, MOTION, first, &z);
    LANE(get)(&block->h, 1, first, &h);
    for (int64_t from = 0, to; from < block->n; from = to) {
        reals margin = {0.0};
        to = some_more(block, from);
        LANE(put)(block->motion, MOTION, first, &z);
        for (int64_t i = from; i < to; i++) {
            LANE(steer)(block, first, (double)i * h, &f);
            const reals q = LANE(push)(&f, z.heading, z.vx, z.vy, z.yaw_rate, &push_x, &push_y, &turn, &margin);
            z.vx = z.vx + push_x;
            z.vy = z.vy + push_y;
            z.yaw_rate = z.yaw_rate + turn;
            z.x = z.x + h * z.vx;
            z.y = z.y + h * z.vy;
            z.heading = z.heading + h * z.yaw_rate;
            z.fastest = LANE(largest)(z.fastest, q);
            z.left = LANE(least)(z.left, z.yaw_rate);
            z.right = LANE(largest)(z.right, z.yaw_rate);
        }
        LANE(mend)(block, first, from, to, margin, &z);
        if (LANE(all_over)(&z, to))
            break;
    }
    LANE(finish)(block, first, &f, &z);
}

static __attribute__((unused)) void LANE(rk4)(struct block *block, int first)
{
    struct LANE(push) f;
    struct LANE(motion) z;
    reals h, x1, x2, x3, x4, y1, y2, y3, y4, t1, t2, t3, t4;
    LANE(get)(block->push, PUSH, first, &f);
    LANE(get)(block->motion, MOTION, first, &z);
    LANE(get)(&block->h, 1, first, &h);
    const reals half = 0.5 * h, sixth = h / 6.0, square = h * h / 6.0;
    for (int64_t from = 0, to; from < block->n; from = to) {
        reals margin = {0.0};
        to = some_more(block, from);
        LANE(put)(block->motion, MOTION, first, &z);
        for (int64_t i = from; i < to; i++) {
            const reals t = (double)i * h;
            LANE(steer)(block, first, t, &f);
            const reals q1 = LANE(push)(&f, z.heading, z.vx, z.vy, z.yaw_rate, &x1, &y1, &t1, &margin);
            const reals r2 = z.yaw_rate + half * t1;
            LANE(steer)(block, first, t + half, &f);
            const reals q2 = LANE(push)(&f, z.heading + half * z.yaw_rate, z.vx + half * x1, z.vy + half * y1, r2,
                                        &x2, &y2, &t2, &margin);
            const reals r3 = z.yaw_rate + half * t2;
            const reals q3 = LANE(push)(&f, z.heading + half * r2, z.vx + half * x2, z.vy + half * y2, r3, &x3, &y3,
                                        &t3, &margin);
            const reals r4 = z.yaw_rate + h * t3;
            LANE(steer)(block, first, t + h, &f);
            const reals q4 =
                LANE(push)(&f, z.heading + h * r3, z.vx + h * x3, z.vy + h * y3, r4, &x4, &y4, &t4, &margin);
            z.x = z.x + h * z.vx + square * (x1 + x2 + x3);
            z.y = z.y + h * z.vy + square * (y1 + y2 + y3);
            z.heading = z.heading + h * z.yaw_rate + square * (t1 + t2 + t3);
            z.vx = z.vx + sixth * (x1 + 2.0 * x2 + 2.0 * x3 + x4);
            z.vy = z.vy + sixth * (y1 + 2.0 * y2 + 2.0 * y3 + y4);
            z.yaw_rate = z.yaw_rate + sixth * (t1 + 2.0 * t2 + 2.0 * t3 + t4);
            z.fastest = LANE(largest)(LANE(largest)(LANE(largest)(LANE(largest)(z.fastest, q1), q2), q3), q4);
            z.left = LANE(least)(LANE(least)(LANE(least)(LANE(least)(z.left, r2), r3), r4), z.yaw_rate);
            z.right = LANE(largest)(LANE(largest)(LANE(largest)(LANE(largest)(z.right, r2), r3), r4), z.yaw_rate);
        }
        LANE(mend)(block, first, from, to, margin, &z);
        if (LANE(all_over)(&z, to))
            break;
    }
    LANE(finish)(block, first, &f, &z);
}

#undef reals
#undef bits
