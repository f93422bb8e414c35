#include "fleet.h"

#include <string.h>

#include "environment.h"
#include "logarithm.c"
#include "trig.c"

#include "kernel.c"

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
    struct drive drive = {.start = controls_at(fleet->controls, i), .rate = controls_at(fleet->slopes, i)};
    for (int k = 0; k < FLEET_CONTROLS; k++)
        drive.varies = drive.varies || of(&fleet->slopes[k], i) != 0.0;
    return drive;
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

/* ---- a block of craft, side by side */

enum { BLOCK = 8 };
/* The rows of a block: the parts of a state, and, of the stretch so far, the largest q [m/s], the least and the largest
   yaw rate; of struct load_function what plain drag needs; and what `steer` needs. */
enum { FASTEST = COMPONENTS, LEFT, RIGHT, MOTION };
enum { X_D, DRAG, TURNING_DRAG, THRUST, SIDE, TURN, PUSH };
enum { HELM = 12 };

struct block {
    const struct fleet *fleet;
    int filled;
    bool rk4;
    bool varies;            /* the controls, of each */
    int64_t n;              /* sub-steps, of each */
    int64_t number[BLOCK];  /* in the fleet */
    double h[BLOCK], k[BLOCK], drag_rate[BLOCK];
    double motion[MOTION][BLOCK], push[PUSH][BLOCK], helm[HELM][BLOCK];
    double stability[BLOCK], rotation[BLOCK]; /* at the least: of what the scalar kernel has done */
};

static void put_rows(double (*rows)[BLOCK], int n, int lane, const double *values)
{
    for (int k = 0; k < n; k++)
        rows[k][lane] = values[k];
}

static struct state state_in(const struct block *block, int lane)
{
    double y[COMPONENTS];
    for (int k = 0; k < COMPONENTS; k++)
        y[k] = block->motion[k][lane];
    return state_of(y);
}

static void put_state_in(struct block *block, int lane, const struct state *state)
{
    double y[COMPONENTS];
    components_of(state, y);
    put_rows(block->motion, COMPONENTS, lane, y);
}

static struct load_function loads_on(const struct drive *drive, const struct craft *craft, bool rk4, double h)
{
    const double time = rk4 ? 1.0 : h;
    return load_function(drive, craft, time / craft->mass, time / craft->inertia);
}

/* After so many sub-steps it is seen whether an angle was rare. */
enum { SOME = 8 };

static int64_t some_more(const struct block *block, int64_t from)
{
    return block->n - from < SOME ? block->n : from + SOME;
}

static void watch_too(struct block *block, int lane, const struct stretch *stretch)
{
    block->stability[lane] = larger(block->stability[lane], stretch->stability);
    block->rotation[lane] = larger(block->rotation[lane], stretch->rotation);
}

/* By the scalar kernel, from the state that is in the block, and the loads at the end. */
static void again(struct block *block, int64_t from, int64_t to, int lane)
{
    const struct drive drive = drive_at(block->fleet, block->number[lane]);
    const struct craft craft = craft_at(block->fleet, block->number[lane]);
    const double h = block->h[lane];
    struct load_function f = loads_on(&drive, &craft, block->rk4, h);
    struct state state = state_in(block, lane);
    for (int64_t i = from; i < to; i++) {
        f.begun = (double)i * h;
        const struct stretch one = block->rk4 ? smooth_rk4(&state, &f, h, 1) : semi_implicit_euler(&state, &f, h, 1);
        watch_too(block, lane, &one);
        state = one.state;
    }
    struct watch watch = {0.0, state.yaw_rate, state.yaw_rate};
    const struct stretch end = stretch_of(&f, &state, 0, h, &watch);
    watch_too(block, lane, &end);
    put_state_in(block, lane, &state);
}

/* The lanes whose bit is set. */
static __attribute__((noinline)) void substeps_again(struct block *block, int64_t from, int64_t to, unsigned which)
{
    for (int lane = 0; lane < BLOCK; lane++)
        if (which & 1u << lane)
            again(block, from, to, lane);
}

static const int64_t SIGN = INT64_MIN;

/* With the registers that every processor has, RK4 goes best four at a time, the default eight at a time. */
#define LANES 4
#define LANE(name) four_##name
#include "lanes.h"
#undef LANES
#undef LANE
#define LANES 8
#define LANE(name) eight_##name
#include "lanes.h"
#undef LANE

/* Once more for newer processors. */
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
#define wide_semi_implicit_euler eight_semi_implicit_euler
#define wide_rk4 eight_rk4

static bool is_wide(void)
{
    return false;
}
#endif

/* ---- a block of them */

/* Put craft i into the block; false where it is not one that goes side by side with those that are there. */
static bool joins(struct block *block, const struct fleet *fleet, const struct way *way, int64_t i)
{
    const int lane = block->filled;
    const bool rk4 = way->integrator == RK4;
    const double step = of(&way->communication_step, i);
    int64_t n;
    double h;
    if ((!rk4 && way->integrator != SEMI_IMPLICIT_EULER) || !are_numbers(fleet, i) || !is_way(way, i) || step == 0.0 ||
        !substeps(step, of(&way->step_size, i), &n, &h))
        return false;
    const struct drive drive = drive_at(fleet, i);
    const struct craft craft = craft_at(fleet, i);
    const struct load_function f = loads_on(&drive, &craft, rk4, h);
    if (rubs(&craft) || f.kind != PLAIN_DRAG || (lane > 0 && (n != block->n || drive.varies != block->varies)))
        return false;
    const struct state state = state_at(fleet, i);
    const double push[PUSH] = {f.x_d, f.drag, f.turning_drag, f.thrust, f.side, f.turn};
    const double helm[HELM] = {drive.start.thrust, drive.start.port, drive.start.starboard, drive.rate.thrust,
                               drive.rate.port, drive.rate.starboard, craft.thrust_min, craft.thrust_max,
                               craft.steering_force, thruster_moment(&craft), f.per_mass, f.per_inertia};
    const double watched[] = {0.0, state.yaw_rate, state.yaw_rate};
    block->fleet = fleet;
    block->filled++;
    block->rk4 = rk4;
    block->varies = drive.varies;
    block->n = n;
    block->number[lane] = i;
    block->h[lane] = h;
    block->k[lane] = f.k;
    block->drag_rate[lane] = f.drag_rate;
    block->stability[lane] = block->rotation[lane] = 0.0;
    put_state_in(block, lane, &state);
    put_rows(&block->motion[FASTEST], MOTION - FASTEST, lane, watched);
    put_rows(block->push, PUSH, lane, push);
    put_rows(block->helm, HELM, lane, helm);
    return true;
}

static void repeat(double (*rows)[BLOCK], int n, int lane)
{
    for (int k = 0; k < n; k++)
        rows[k][lane] = rows[k][0];
}

/* A lane that is not filled has what the first has. */
static void fill(struct block *block, int lane)
{
    block->number[lane] = block->number[0];
    repeat(&block->h, 1, lane);
    repeat(block->motion, MOTION, lane);
    repeat(block->push, PUSH, lane);
    repeat(block->helm, HELM, lane);
}

static void carry_out(struct block *block, bool wide)
{
    if (wide)
        (block->rk4 ? wide_rk4 : wide_semi_implicit_euler)(block, 0);
    else if (!block->rk4)
        eight_semi_implicit_euler(block, 0);
    else
        for (int first = 0; first < block->filled; first += 4)
            four_rk4(block, first);
}

/* How many of its craft were refused. */
static int64_t advance_block(struct block *block, const struct fleet *fleet, const struct reached *reached,
                             bool wide)
{
    int64_t refused = 0;
    for (int lane = block->filled; lane < BLOCK; lane++)
        fill(block, lane);
    carry_out(block, wide);
    for (int i = 0; i < block->filled; i++) {
        double (*const z)[BLOCK] = block->motion;
        const double h = block->h[i];
        struct stretch made = {
            .state = state_in(block, i),
            .substeps = block->n,
            .stability = larger(block->stability[i], h * (block->k[i] * z[FASTEST][i] * block->drag_rate[i])),
            .rotation = larger(block->rotation[i], h * larger(z[RIGHT][i], -z[LEFT][i])),
            .substep = h,
        };
        refused += settle(fleet, reached, block->number[i], (enum refusal)checked(&made), &made);
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
        way->integrator < SEMI_IMPLICIT_EULER || way->integrator > SPLITTING)
        return -1;
    const struct environment host = environment_enter();
    const bool wide = is_wide();
    struct block block = {.filled = 0};
    int64_t refused = 0;
    for (int64_t i = 0; i < fleet->count; i++) {
        if (joins(&block, fleet, way, i)) {
            if (block.filled == BLOCK)
                refused += advance_block(&block, fleet, reached, wide);
        } else {
            refused += advance_alone(fleet, way, reached, i);
        }
    }
    if (block.filled > 0)
        refused += advance_block(&block, fleet, reached, wide);
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
