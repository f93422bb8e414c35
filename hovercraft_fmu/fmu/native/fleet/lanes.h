/* Plain drag with controls that hold, LANES craft side by side: the loops of kernel.c, operation by operation, so that
   each lane has its bits. Included once for each instruction set; LANE(name) gives the names. Between functions that are
   not in line lanes go by pointer: on Windows a copy on the stack may be aligned too little. */

/* trig_sine_cosine of each lane. What is rare there is left to it. */
static ALWAYS_INLINE void LANE(sine_cosine)(lanes angle, lanes *sine, lanes *cosine)
{
    const lanes size = (lanes)((bits)angle & ~SIGN);
    const bits small = size <= TRIG_QUARTER;
    const lanes shifted = angle * TRIG_INVPIO2 + TRIG_TO_INTEGER; /* its last two bits are the quarters modulo 4 */
    const bits n = (bits)shifted & ~small;
    const lanes quarters = (lanes)((bits)(shifted - TRIG_TO_INTEGER) & ~small);
    const lanes low = quarters * PIO2_1T, r = angle - quarters * PIO2_1, y = r - low, tail = (r - y) - low;
    const bits rare = ~(size < TRIG_LARGE) | (~small & ((lanes)((bits)y & ~SIGN) < 0x1p-16 * size));
    lanes s, c;
    TRIG_POLYNOMIALS(lanes, y, tail, s, c);
    const bits odd = -(n & 1);
    *sine = (lanes)(((odd & (bits)c) | (~odd & (bits)s)) ^ (n & 2) << 62);
    *cosine = (lanes)(((odd & (bits)s) | (~odd & (bits)c)) ^ ((n + 1) & 2) << 62);
    if (any(&rare))
        of_rare(&rare, &angle, sine, cosine);
}

/* What the loads add to the velocities, and q. */
static ALWAYS_INLINE lanes LANE(push)(const struct push *f, lanes heading, lanes vx, lanes vy, lanes yaw_rate,
                                      lanes *push_x, lanes *push_y, lanes *turn)
{
    lanes c, s;
    LANE(sine_cosine)(heading, &s, &c);
    const lanes u = c * vx + s * vy;
    const lanes w = c * vy - s * vx + yaw_rate * f->x_d;
    const lanes q = root(u * u + w * w);
    const lanes ahead = f->thrust - f->drag * u * q;
    const lanes abeam = f->side - f->drag * w * q;
    *turn = f->turn - f->turning_drag * w * q;
    *push_x = c * ahead - s * abeam;
    *push_y = s * ahead + c * abeam;
    return q;
}

static void LANE(semi_implicit_euler)(const struct push *push, const lanes *step, int64_t n,
                                      struct lane_states *states)
{
    const struct push f = *push;
    const lanes h = *step;
    struct lane_states z = *states;
    lanes push_x, push_y, turn;
    for (int64_t i = 0; i < n; i++) {
        const lanes q = LANE(push)(&f, z.heading, z.vx, z.vy, z.yaw_rate, &push_x, &push_y, &turn);
        z.vx = z.vx + push_x;
        z.vy = z.vy + push_y;
        z.yaw_rate = z.yaw_rate + turn;
        z.x = z.x + h * z.vx;
        z.y = z.y + h * z.vy;
        z.heading = z.heading + h * z.yaw_rate;
        z.fastest = largest(z.fastest, q);
        z.left = least(z.left, z.yaw_rate);
        z.right = largest(z.right, z.yaw_rate);
    }
    z.fastest = largest(z.fastest, LANE(push)(&f, z.heading, z.vx, z.vy, z.yaw_rate, &push_x, &push_y, &turn));
    *states = z;
}

static void LANE(rk4)(const struct push *push, const lanes *step, int64_t n, struct lane_states *states)
{
    const struct push f = *push;
    const lanes h = *step, half = 0.5 * h, sixth = h / 6.0, square = h * h / 6.0;
    struct lane_states z = *states;
    lanes x1, x2, x3, x4, y1, y2, y3, y4, t1, t2, t3, t4;
    for (int64_t i = 0; i < n; i++) {
        const lanes q1 = LANE(push)(&f, z.heading, z.vx, z.vy, z.yaw_rate, &x1, &y1, &t1);
        const lanes r2 = z.yaw_rate + half * t1;
        const lanes q2 = LANE(push)(&f, z.heading + half * z.yaw_rate, z.vx + half * x1, z.vy + half * y1, r2, &x2,
                                    &y2, &t2);
        const lanes r3 = z.yaw_rate + half * t2;
        const lanes q3 =
            LANE(push)(&f, z.heading + half * r2, z.vx + half * x2, z.vy + half * y2, r3, &x3, &y3, &t3);
        const lanes r4 = z.yaw_rate + h * t3;
        const lanes q4 = LANE(push)(&f, z.heading + h * r3, z.vx + h * x3, z.vy + h * y3, r4, &x4, &y4, &t4);
        z.x = z.x + h * z.vx + square * (x1 + x2 + x3);
        z.y = z.y + h * z.vy + square * (y1 + y2 + y3);
        z.heading = z.heading + h * z.yaw_rate + square * (t1 + t2 + t3);
        z.vx = z.vx + sixth * (x1 + 2.0 * x2 + 2.0 * x3 + x4);
        z.vy = z.vy + sixth * (y1 + 2.0 * y2 + 2.0 * y3 + y4);
        z.yaw_rate = z.yaw_rate + sixth * (t1 + 2.0 * t2 + 2.0 * t3 + t4);
        z.fastest = largest(largest(largest(largest(z.fastest, q1), q2), q3), q4);
        z.left = least(least(least(least(z.left, r2), r3), r4), z.yaw_rate);
        z.right = largest(largest(largest(largest(z.right, r2), r3), r4), z.yaw_rate);
    }
    z.fastest = largest(z.fastest, LANE(push)(&f, z.heading, z.vx, z.vy, z.yaw_rate, &x1, &y1, &t1));
    *states = z;
}
