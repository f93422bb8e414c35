#include "fleet.h"

#include <string.h>

#include "environment.h"
#include "logarithm.c"
#include "trig.c"

#include "kernel.c"

/* ---- side by side */

enum { LANES = 8 };
typedef double lanes __attribute__((vector_size(LANES * sizeof(double))));
typedef int64_t bits __attribute__((vector_size(LANES * sizeof(int64_t))));

static const int64_t SIGN = INT64_MIN;

/* Of a stretch, so far; `fastest` is the largest q [m/s], left and right are the least and the largest yaw rate. */
struct lane_states {
    lanes x, y, heading, vx, vy, yaw_rate;
    lanes fastest, left, right;
};

/* Of struct load_function, what plain drag needs. */
struct push {
    lanes x_d, drag, turning_drag, thrust, side, turn;
};

static ALWAYS_INLINE lanes largest(lanes a, lanes b)
{
    const bits beyond = b > a;
    return (lanes)((beyond & (bits)b) | (~beyond & (bits)a));
}

static ALWAYS_INLINE lanes least(lanes a, lanes b)
{
    const bits beyond = b < a;
    return (lanes)((beyond & (bits)b) | (~beyond & (bits)a));
}

static ALWAYS_INLINE lanes root(lanes a)
{
#if defined(__clang__) && __clang_major__ >= 18
    return __builtin_elementwise_sqrt(a);
#else
    for (int i = 0; i < LANES; i++)
        a[i] = square_root(a[i]);
    return a;
#endif
}

static ALWAYS_INLINE bool any(const bits *mask)
{
    int64_t all = 0;
    for (int i = 0; i < LANES; i++)
        all |= (*mask)[i];
    return all != 0;
}

/* Not in line: large angles, and those very close to a multiple of pi/2. */
static __attribute__((noinline)) void of_rare(const bits *rare, const lanes *angle, lanes *sine, lanes *cosine)
{
    for (int i = 0; i < LANES; i++)
        if ((*rare)[i]) {
            struct trig_turn turn = {.quarters = 0.0};
            const struct trig_pair pair = trig_sine_cosine((*angle)[i], &turn);
            (*sine)[i] = pair.sine;
            (*cosine)[i] = pair.cosine;
        }
}

#define LANE(name) lanes_##name
#include "lanes.h"
#undef LANE

/* Once more for newer processors, which have them four at a time. */
#if defined(__x86_64__) && !defined(FLEET_BASELINE)
#include <cpuid.h>

#if defined(__clang__)
#pragma clang attribute push(__attribute__((target("avx2"))), apply_to = function)
#else
#pragma GCC push_options
#pragma GCC target("avx2")
#endif
#define LANE(name) wide_##name
#include "lanes.h"
#undef LANE
#if defined(__clang__)
#pragma clang attribute pop
#else
#pragma GCC pop_options
#endif

/* Whether processor and system have AVX2. */
static bool is_wide(void)
{
    unsigned a, b, c, d, low, high;
    const unsigned system_saves = 1u << 27, avx = 1u << 28, avx2 = 1u << 5, registers = 6;
    if (!__get_cpuid(1, &a, &b, &c, &d) || !(c & system_saves) || !(c & avx))
        return false;
    __asm__("xgetbv" : "=a"(low), "=d"(high) : "c"(0));
    return (low & registers) == registers && __get_cpuid_count(7, 0, &a, &b, &c, &d) && (b & avx2);
}
#else
#define wide_semi_implicit_euler lanes_semi_implicit_euler
#define wide_rk4 lanes_rk4

static bool is_wide(void)
{
    return false;
}
#endif

/* ---- one craft of the fleet */

static double of(const struct column *column, int64_t i)
{
    return column->values[i * column->stride];
}

static void gather(const struct column *columns, int n, int64_t i, double *values)
{
    for (int k = 0; k < n; k++)
        values[k] = of(&columns[k], i);
}

_Static_assert(sizeof(struct state) == FLEET_STATES * sizeof(double), "a column for each");
_Static_assert(sizeof(struct controls) == FLEET_CONTROLS * sizeof(double), "a column for each");

static struct state state_at(const struct fleet *fleet, int64_t i)
{
    struct state state;
    double values[FLEET_STATES];
    gather(fleet->states, FLEET_STATES, i, values);
    memcpy(&state, values, sizeof state);
    return state;
}

static struct craft craft_at(const struct fleet *fleet, int64_t i)
{
    double v[FLEET_CONSTANTS];
    gather(fleet->constants, FLEET_CONSTANTS, i, v);
    return (struct craft){
        .mass = v[0], .inertia = v[1], .length = v[2], .width = v[3], .height = v[4], .drag_coefficient = v[5],
        .air_density = v[6], .drag_center_fraction = v[7], .steering_force = v[8], .thrust_min = v[9],
        .thrust_max = v[10], .drag_area = v[11] == (double)DIRECTIONAL ? DIRECTIONAL : CONSTANT,
        .skirt_friction = v[12], .gravity = v[13], .rotational_drag = v[14],
    };
}

static struct controls controls_at(const struct column *columns, int64_t i)
{
    struct controls controls;
    double values[FLEET_CONTROLS];
    gather(columns, FLEET_CONTROLS, i, values);
    memcpy(&controls, values, sizeof controls);
    return controls;
}

static struct drive drive_at(const struct fleet *fleet, int64_t i)
{
    const struct controls rate = controls_at(fleet->slopes, i);
    return (struct drive){
        .start = controls_at(fleet->controls, i),
        .rate = rate,
        .varies = rate.thrust != 0.0 || rate.port != 0.0 || rate.starboard != 0.0 || rate.wind_x != 0.0 ||
                  rate.wind_y != 0.0,
    };
}

static bool are_finite(const struct column *columns, int n, int64_t i)
{
    for (int k = 0; k < n; k++)
        if (!isfinite(of(&columns[k], i)))
            return false;
    return true;
}

static bool are_numbers(const struct fleet *fleet, int64_t i)
{
    return are_finite(fleet->states, FLEET_STATES, i) && are_finite(fleet->controls, FLEET_CONTROLS, i) &&
           are_finite(fleet->slopes, FLEET_CONTROLS, i) && are_finite(fleet->constants, FLEET_CONSTANTS, i);
}

/* What may be asked of the kernel: a step of 0 it would not take, others it could not end. */
static bool is_way(const struct way *way, int64_t i)
{
    const double step = of(&way->communication_step, i), size = of(&way->step_size, i);
    const double tolerance = of(&way->tolerance, i), proposed = of(&way->proposed, i);
    return 0.0 <= step && step < INFINITY && 0.0 < size && size < INFINITY && 0.0 < tolerance &&
           tolerance < INFINITY && 0.0 <= proposed && proposed < INFINITY;
}

static void put_state(const struct reached *reached, int64_t i, const struct state *state)
{
    double values[FLEET_STATES];
    memcpy(values, state, sizeof values);
    for (int k = 0; k < FLEET_STATES; k++)
        reached->states[k][i] = values[k];
}

/* Of what is not finite the velocities are told first: it is they that run away first. */
static int32_t part_to_tell(const struct state *state)
{
    static const int32_t order[FLEET_STATES] = {VX, VY, YAW_RATE, X, Y, HEADING};
    double values[FLEET_STATES];
    memcpy(values, state, sizeof values);
    int k = 0;
    while (k + 1 < FLEET_STATES && isfinite(values[order[k]]))
        k++;
    return order[k];
}

/* Write down what became of craft i; whether it was refused. */
static bool settle(const struct fleet *fleet, const struct reached *reached, int64_t i, enum refusal why,
                   const struct stretch *stretch)
{
    const struct state before = state_at(fleet, i);
    const bool moved = why == MOVED;
    const int32_t part = why == RUNAWAY ? part_to_tell(&stretch->state) : 0;
    double values[FLEET_STATES];
    memcpy(values, &stretch->state, sizeof values);
    put_state(reached, i, moved ? &stretch->state : &before);
    reached->why[i] = why;
    reached->part[i] = part;
    reached->value[i] = why == RUNAWAY ? values[part] : 0.0;
    reached->substep[i] = stretch->substep;
    reached->substeps[i] = moved ? stretch->substeps : 0;
    reached->stability[i] = moved ? stretch->stability : 0.0;
    reached->rotation[i] = moved ? stretch->rotation : 0.0;
    reached->proposed[i] = stretch->proposed;
    return !moved;
}

static bool advance_alone(const struct fleet *fleet, const struct way *way, const struct reached *reached, int64_t i)
{
    const struct state state = state_at(fleet, i);
    const double step = of(&way->communication_step, i), proposed = of(&way->proposed, i);
    struct stretch stretch = {.state = state, .proposed = proposed};
    if (!are_numbers(fleet, i))
        return settle(fleet, reached, i, NOT_A_NUMBER, &stretch);
    if (!is_way(way, i))
        return settle(fleet, reached, i, NOT_A_STEP, &stretch);
    if (step == 0.0)
        return settle(fleet, reached, i, MOVED, &stretch);
    const struct drive drive = drive_at(fleet, i);
    const struct craft craft = craft_at(fleet, i);
    const struct settings settings = {of(&way->step_size, i), way->integrator, of(&way->tolerance, i)};
    const enum outcome outcome = kernel_advance(&state, &drive, &craft, step, &settings, proposed, &stretch);
    return settle(fleet, reached, i, (enum refusal)outcome, &stretch);
}

/* ---- a block of them */

struct block {
    int filled;
    int64_t n;              /* sub-steps, of each */
    int64_t craft[LANES];
    double h[LANES];
    struct state states[LANES];
    struct load_function loads[LANES];
};

/* Put craft i into the block; false where it is not one that goes side by side with those that are there. */
static bool joins(struct block *block, const struct fleet *fleet, const struct way *way, int64_t i)
{
    const bool euler = way->integrator == SEMI_IMPLICIT_EULER;
    const double step = of(&way->communication_step, i);
    int64_t n;
    double h;
    if ((!euler && way->integrator != RK4) || !are_numbers(fleet, i) || !is_way(way, i) || step == 0.0 ||
        !substeps(step, of(&way->step_size, i), &n, &h) || (block->filled > 0 && n != block->n))
        return false;
    const struct drive drive = drive_at(fleet, i);
    const struct craft craft = craft_at(fleet, i);
    const double time = euler ? h : 1.0;
    const struct load_function f = load_function(&drive, &craft, time / craft.mass, time / craft.inertia);
    if (drive.varies || rubs(&craft) || f.kind != PLAIN_DRAG)
        return false;
    const int lane = block->filled++;
    block->n = n;
    block->craft[lane] = i;
    block->h[lane] = h;
    block->states[lane] = state_at(fleet, i);
    block->loads[lane] = f;
    return true;
}

#define EACH(lane_values, member) \
    for (int each = 0; each < LANES; each++) \
    (lane_values)[each] = (member)

static void load(const struct block *block, struct push *f, struct lane_states *z, lanes *h)
{
    EACH(f->x_d, block->loads[each].x_d);
    EACH(f->drag, block->loads[each].drag);
    EACH(f->turning_drag, block->loads[each].turning_drag);
    EACH(f->thrust, block->loads[each].thrust);
    EACH(f->side, block->loads[each].side);
    EACH(f->turn, block->loads[each].turn);
    EACH(z->x, block->states[each].x);
    EACH(z->y, block->states[each].y);
    EACH(z->heading, block->states[each].heading);
    EACH(z->vx, block->states[each].vx);
    EACH(z->vy, block->states[each].vy);
    EACH(z->yaw_rate, block->states[each].yaw_rate);
    EACH(z->fastest, 0.0);
    z->left = z->right = z->yaw_rate;
    EACH(*h, block->h[each]);
}

/* Carry out a block; how many of its craft were refused. Lanes that are not filled have what the first has. */
static int64_t advance_block(struct block *block, const struct fleet *fleet, const struct way *way,
                             const struct reached *reached, bool wide)
{
    struct push f;
    struct lane_states z;
    lanes h;
    int64_t refused = 0;
    for (int lane = block->filled; lane < LANES; lane++) {
        block->states[lane] = block->states[0];
        block->loads[lane] = block->loads[0];
        block->h[lane] = block->h[0];
    }
    load(block, &f, &z, &h);
    if (way->integrator == RK4)
        (wide ? wide_rk4 : lanes_rk4)(&f, &h, block->n, &z);
    else
        (wide ? wide_semi_implicit_euler : lanes_semi_implicit_euler)(&f, &h, block->n, &z);
    for (int i = 0; i < block->filled; i++) {
        struct stretch made = {
            .state = {z.x[i], z.y[i], z.heading[i], z.vx[i], z.vy[i], z.yaw_rate[i]},
            .substeps = block->n,
            .stability = h[i] * (block->loads[i].k * z.fastest[i] * block->loads[i].drag_rate),
            .rotation = h[i] * larger(z.right[i], -z.left[i]),
            .substep = h[i],
        };
        refused += settle(fleet, reached, block->craft[i], (enum refusal)checked(&made), &made);
    }
    block->filled = 0;
    return refused;
}

/* ---- all of them */

static bool is_there(const struct column *columns, int n)
{
    for (int k = 0; k < n; k++)
        if (!columns[k].values)
            return false;
    return true;
}

static bool is_fleet(const struct fleet *fleet)
{
    return fleet && fleet->count >= 0 && is_there(fleet->states, FLEET_STATES) &&
           is_there(fleet->controls, FLEET_CONTROLS) && is_there(fleet->slopes, FLEET_CONTROLS) &&
           is_there(fleet->constants, FLEET_CONSTANTS);
}

static bool can_be_reached(const struct reached *reached)
{
    if (!reached)
        return false;
    for (int k = 0; k < FLEET_STATES; k++)
        if (!reached->states[k])
            return false;
    return reached->substeps && reached->stability && reached->rotation && reached->proposed && reached->why &&
           reached->part && reached->value && reached->substep;
}

int64_t fleet_advance(const struct fleet *fleet, const struct way *way, const struct reached *reached)
{
    if (!is_fleet(fleet) || !way || !is_there(&way->communication_step, 1) || !is_there(&way->step_size, 1) ||
        !is_there(&way->tolerance, 1) || !is_there(&way->proposed, 1) || !can_be_reached(reached) ||
        way->integrator < SEMI_IMPLICIT_EULER || way->integrator > ADAPTIVE)
        return -1;
    const struct environment host = environment_enter();
    const bool wide = is_wide();
    struct block block = {.filled = 0};
    int64_t refused = 0;
    for (int64_t i = 0; i < fleet->count; i++) {
        if (joins(&block, fleet, way, i)) {
            if (block.filled == LANES)
                refused += advance_block(&block, fleet, way, reached, wide);
        } else {
            refused += advance_alone(fleet, way, reached, i);
        }
    }
    if (block.filled > 0)
        refused += advance_block(&block, fleet, way, reached, wide);
    environment_leave(&host);
    return refused;
}

int32_t fleet_derived(const struct fleet *fleet, double *derived)
{
    if (!fleet || !derived || fleet->count < 0 || !is_there(fleet->constants, FLEET_CONSTANTS))
        return -1;
    const struct environment host = environment_enter();
    for (int64_t i = 0; i < fleet->count; i++) {
        const struct craft craft = craft_at(fleet, i);
        const struct derived of_craft = kernel_derived(&craft);
        double values[sizeof of_craft / sizeof(double)];
        memcpy(values, &of_craft, sizeof values);
        for (size_t k = 0; k < sizeof values / sizeof *values; k++)
            derived[(int64_t)k * fleet->count + i] = values[k];
    }
    environment_leave(&host);
    return 0;
}

int32_t fleet_observe(const struct fleet *fleet, double *const motion[2], double *const loads[4])
{
    if (!is_fleet(fleet) || !motion || !loads || !motion[0] || !motion[1] || !loads[0] || !loads[1] || !loads[2] ||
        !loads[3])
        return -1;
    const struct environment host = environment_enter();
    for (int64_t i = 0; i < fleet->count; i++) {
        const struct state state = state_at(fleet, i);
        const struct controls controls = controls_at(fleet->controls, i);
        const struct craft craft = craft_at(fleet, i);
        const struct loads on = kernel_loads_on(&state, &controls, &craft);
        kernel_body_velocity(&state, &motion[0][i], &motion[1][i]);
        loads[0][i] = on.x;
        loads[1][i] = on.y;
        loads[2][i] = on.moment;
        loads[3][i] = on.kq;
    }
    environment_leave(&host);
    return 0;
}
