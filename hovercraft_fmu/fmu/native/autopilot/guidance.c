#include "guidance.h"

#include <math.h>
#include <stdbool.h>

#include "arctangent.h"
#include "root.h"
#include "trig.h"

static const double AHEAD = 0.2, BRAKE = 0.3, SHARE = 0.3; /* of the largest thrust */
static const double DAMPED = 1.5;                          /* 1/rad */
static const double STEP_LIMIT = 0.85, STEP_PLANNED = 0.6; /* 1 */
static const double CREEP = 0.1;                           /* of the cruise speed */
static const double MINUTE = 60.0;                         /* s */
static const double PI = 3.141592653589793;

/* The bits of the status. */
enum { ARRIVED = 1, MISSED = 2, AWAY = 4, CIRCLING = 8, SATURATED = 16, WIND = 32, LONG_STEP = 64,
       NOTHING_TO_STEER = 128 };

/* Constants of the three loops. */
struct gains {
    double heading;   /* 1/rad */
    double yaw_rate;  /* s/rad */
    double velocity;  /* kg/s */
    double lag;       /* s */
    double lookahead; /* m */
    double turn_rate; /* rad/s */
};

struct leg {
    double x, y;        /* 1, a unit vector; 0 where the leg has no length */
    double length;      /* m */
    double left;        /* m */
    double cross_track; /* m */
};

struct way {
    double x, y;  /* 1, a unit vector */
    double speed; /* m/s */
};

struct force {
    double x, y; /* N */
};

/* With HOVERCRAFT_LIBM the platform's functions, which Python uses, too. */
#ifdef HOVERCRAFT_LIBM

static struct trig_pair of_angle(double angle)
{
    return (struct trig_pair){sin(angle), cos(angle)};
}

static double angle_to(double y, double x)
{
    return atan2(y, x);
}

#else

static struct trig_pair of_angle(double angle)
{
    struct trig_turn turn = {0.0, 0.0, 0.0, 0};
    return trig_sine_cosine(angle, &turn);
}

static double angle_to(double y, double x)
{
    return angle_of(y, x);
}

#endif

/* ---- arithmetic */

static double share_of(double duration, double lag)
{
    const double z = duration / lag;
    return 1.0 - 1.0 / (1.0 + z * (1.0 + 0.5 * z));
}

static double length_of(double x, double y)
{
    const double most = fabs(x) > fabs(y) ? fabs(x) : fabs(y);
    if (!(0.0 < most && most < INFINITY))
        return most;
    x = x / most;
    y = y / most;
    return most * square_root(x * x + y * y);
}

/* In this order a NaN stays one. */
static double held_within(double value, double low, double high)
{
    return value < low ? low : value > high ? high : value;
}

/* ---- where to go */

static struct leg leg_to(const struct waypoint *origin, const struct waypoint *active, const struct motion *motion)
{
    double x = active->x - origin->x, y = active->y - origin->y;
    const double length = length_of(x, y);
    if (length == 0.0)
        return (struct leg){0.0, 0.0, 0.0, 0.0, 0.0};
    x = x / length;
    y = y / length;
    const double gone_x = motion->x - origin->x, gone_y = motion->y - origin->y;
    return (struct leg){x, y, length, length - (x * gone_x + y * gone_y), x * gone_y - y * gone_x};
}

static void pass_waypoints(struct pilot *pilot, const struct motion *motion, const struct course *course,
                           const struct orders *orders)
{
    while (pilot->passed < course->count) {
        const struct waypoint *active = &course->points[pilot->passed];
        const bool reached = length_of(active->x - motion->x, active->y - motion->y) <= orders->acceptance_radius;
        const struct leg leg = leg_to(&pilot->origin, active, motion);
        const bool beyond = leg.length == 0.0 || (orders->turn_back == 0 && leg.left <= 0.0);
        if (!(reached || beyond))
            return;
        if (!reached)
            pilot->missed++;
        pilot->origin = *active;
        pilot->passed++;
        pilot->swept = 0.0;
    }
}

static struct way along(const struct leg *leg, double speed, const struct gains *gains)
{
    const double ahead = gains->lookahead < leg->left ? gains->lookahead : leg->left;
    const double x = ahead * leg->x + leg->cross_track * leg->y, y = ahead * leg->y - leg->cross_track * leg->x;
    const double length = length_of(x, y);
    if (length == 0.0)
        return (struct way){leg->x, leg->y, speed};
    return (struct way){x / length, y / length, speed};
}

static struct way to_station(const struct waypoint *station, const struct motion *motion, const struct orders *orders,
                             const struct gains *gains)
{
    const double x = station->x - motion->x, y = station->y - motion->y;
    const double distance = length_of(x, y);
    if (distance == 0.0)
        return (struct way){0.0, 0.0, 0.0};
    const double share = distance < gains->lookahead ? distance / gains->lookahead : 1.0;
    return (struct way){x / distance, y / distance, share * orders->cruise_speed};
}

static double corner_square(const struct leg *leg, const struct pilot *pilot, const struct course *course,
                            const struct orders *orders)
{
    if (pilot->passed + 1 >= course->count)
        return orders->keep_station == 1 ? 0.0 : INFINITY;
    const struct waypoint *active = &course->points[pilot->passed], *after = active + 1;
    const double x = after->x - active->x, y = after->y - active->y;
    const double length = length_of(x, y);
    const double cosine = length > 0.0 ? (leg->x * x + leg->y * y) / length : 1.0;
    if (cosine >= 1.0)
        return INFINITY;
    if (cosine <= -1.0)
        return 0.0;
    return SHARE * orders->thrust_max / orders->mass * orders->acceptance_radius *
           square_root((1.0 + cosine) / (1.0 - cosine));
}

static double speed_before_corner(const struct leg *leg, const struct pilot *pilot, const struct motion *motion,
                                  const struct course *course, const struct orders *orders, const struct gains *gains)
{
    double square = corner_square(leg, pilot, course, orders);
    double room = leg->left - orders->acceptance_radius, brake = orders->thrust_max;
    if (orders->thrust_min < 0.0) {
        brake = -orders->thrust_min;
    } else if (pilot->braking == 0) {
        const double half_turn = PI * length_of(motion->vx, motion->vy);
        room = room * gains->turn_rate > half_turn ? room - half_turn / gains->turn_rate : 0.0;
    }
    if (room > 0.0)
        square = square + 2.0 * (SHARE * brake / orders->mass) * room;
    return held_within(square_root(square), CREEP * orders->cruise_speed, orders->cruise_speed);
}

/* ---- how to go there */

static double steering_moment(const struct orders *orders)
{
    return 0.5 * orders->length * orders->steering_force;
}

double guidance_frequency(const struct orders *orders)
{
    return square_root(DAMPED * steering_moment(orders) / orders->inertia);
}

static struct gains gains_for(const struct orders *orders, double duration)
{
    double moment = steering_moment(orders), frequency = guidance_frequency(orders);
    if (frequency == 0.0)
        moment = frequency = 1.0;
    if (2.0 * frequency * duration > STEP_PLANNED)
        frequency = 0.5 * STEP_PLANNED / duration;
    double turn_rate = 0.5 * frequency;
    if (turn_rate > 7.0 * orders->cruise_speed / orders->length)
        turn_rate = 7.0 * orders->cruise_speed / orders->length;
    double lookahead = 5.0 * orders->cruise_speed / frequency;
    if (lookahead < 0.5 * orders->length)
        lookahead = 0.5 * orders->length;
    return (struct gains){
        .heading = orders->heading_gain > 0.0 ? orders->heading_gain
                                              : orders->inertia * frequency * frequency / moment,
        .yaw_rate = orders->yaw_rate_gain > 0.0 ? orders->yaw_rate_gain : 2.0 * orders->inertia * frequency / moment,
        .velocity = orders->velocity_gain > 0.0 ? orders->velocity_gain : 0.8 * orders->mass * frequency,
        .lag = orders->integral_time > 0.0 ? orders->integral_time : 3.0 / frequency,
        .lookahead = orders->lookahead > 0.0 ? orders->lookahead : lookahead,
        .turn_rate = orders->turn_rate > 0.0 ? orders->turn_rate : turn_rate,
    };
}

static struct force lasting_force(const struct pilot *pilot, const struct motion *motion, const struct orders *orders,
                                  const struct gains *gains)
{
    const double rate = orders->mass / gains->lag;
    return (struct force){pilot->push_x + rate * (pilot->vx - motion->vx),
                          pilot->push_y + rate * (pilot->vy - motion->vy)};
}

static struct force wanted_force(const struct way *way, const struct motion *motion, const struct force *lasting,
                                 const struct orders *orders, const struct gains *gains)
{
    const double x = gains->velocity * (way->speed * way->x - motion->vx) + lasting->x;
    const double y = gains->velocity * (way->speed * way->y - motion->vy) + lasting->y;
    const double size = length_of(x, y);
    if (size <= orders->thrust_max)
        return (struct force){x, y};
    return (struct force){x * (orders->thrust_max / size), y * (orders->thrust_max / size)};
}

static struct way into_the_wind(const struct motion *motion, const struct force *force, const struct orders *orders)
{
    const double size = length_of(force->x, force->y);
    if (size > AHEAD * orders->thrust_max)
        return (struct way){force->x / size, force->y / size, 0.0};
    const struct trig_pair bow = of_angle(motion->heading);
    return (struct way){bow.cosine, bow.sine, 0.0};
}

static int32_t brakes(const struct pilot *pilot, const struct motion *motion, const struct way *way,
                      const struct force *force, const struct orders *orders, const struct gains *gains)
{
    const double ahead = force->x * way->x + force->y * way->y;
    if (ahead > 0.0)
        return 0;
    if (ahead < -BRAKE * orders->thrust_max && fabs(motion->yaw_rate) < 0.3 * gains->turn_rate)
        return 1;
    return pilot->braking;
}

static double wanted_turn(int32_t braking, const struct motion *motion, const struct way *way,
                          const struct force *force, const struct orders *orders)
{
    const double push = braking == 1 ? -1.0 : 1.0;
    const double bow = braking == 1 && orders->thrust_min >= 0.0 ? -1.0 : 1.0;
    const struct trig_pair heading = of_angle(motion->heading);
    const double cosine = heading.cosine, sine = heading.sine;
    const double x = bow * way->x, y = bow * way->y;
    const double across = cosine * y - sine * x, abreast = cosine * x + sine * y;
    const double turn = angle_to(across, abreast);
    if (abreast <= 0.0)
        return turn;
    double ahead = push * (force->x * way->x + force->y * way->y);
    if (ahead < AHEAD * orders->thrust_max)
        ahead = AHEAD * orders->thrust_max;
    return turn + angle_to(push * (force->y * way->x - force->x * way->y), ahead);
}

static struct commands helm(struct pilot *pilot, const struct motion *motion, const struct force *force, double turn,
                            const struct orders *orders, const struct gains *gains, double duration)
{
    const struct trig_pair heading = of_angle(motion->heading), asked = of_angle(pilot->heading);
    const double cosine = heading.cosine, sine = heading.sine;
    const double asked_x = asked.cosine, asked_y = asked.sine;
    double error = angle_to(cosine * asked_y - sine * asked_x, cosine * asked_x + sine * asked_y);
    const double most = gains->turn_rate * duration;
    error = error + held_within(turn - error, -most, most);
    const double steering = held_within(gains->heading * error - gains->yaw_rate * motion->yaw_rate, -1.0, 1.0);
    const double thrust =
        held_within(force->x * cosine + force->y * sine, orders->thrust_min, orders->thrust_max);
    pilot->heading = motion->heading + error;
    return (struct commands){thrust, steering > 0.0 ? steering : 0.0, steering < 0.0 ? -steering : 0.0};
}

/* ---- what is remembered */

static struct force pushed(const struct motion *motion, const struct commands *commands, const struct orders *orders)
{
    const struct trig_pair heading = of_angle(motion->heading);
    const double cosine = heading.cosine, sine = heading.sine;
    const double side = orders->steering_force * (commands->port - commands->starboard);
    return (struct force){commands->thrust * cosine - side * sine, commands->thrust * sine + side * cosine};
}

static void learn(struct pilot *pilot, const struct motion *motion, const struct force *lasting,
                  const struct commands *commands, const struct orders *orders, const struct gains *gains,
                  double duration)
{
    const struct force told = pushed(motion, commands, orders);
    const double share = share_of(duration, gains->lag);
    pilot->push_x = lasting->x + share * (told.x - lasting->x);
    pilot->push_y = lasting->y + share * (told.y - lasting->y);
    pilot->x = motion->x;
    pilot->y = motion->y;
    pilot->vx = motion->vx;
    pilot->vy = motion->vy;
}

static void watch(struct pilot *pilot, const struct motion *motion, const struct waypoint *active, bool arrived,
                  const struct way *way, const struct force *lasting, const struct commands *commands,
                  const struct orders *orders, double duration)
{
    const double from_x = pilot->x - active->x, from_y = pilot->y - active->y;
    const double to_x = motion->x - active->x, to_y = motion->y - active->y;
    const double swept = angle_to(from_x * to_y - from_y * to_x, from_x * to_x + from_y * to_y);
    const double share = share_of(duration, MINUTE);
    const double at_limit = commands->port >= 1.0 || commands->starboard >= 1.0 ? 1.0 : 0.0;
    const double needed = lasting->x * way->x + lasting->y * way->y;
    const double made_good = motion->vx * way->x + motion->vy * way->y;
    const bool in_vain = needed >= 0.9 * orders->thrust_max && made_good < CREEP * orders->cruise_speed;
    pilot->swept = arrived ? 0.0 : pilot->swept + swept;
    pilot->saturated = pilot->saturated + share * (at_limit - pilot->saturated);
    pilot->driven = pilot->driven + share * ((in_vain ? 1.0 : 0.0) - pilot->driven);
}

static double step_number(const struct orders *orders, double duration)
{
    if (orders->yaw_rate_gain > 0.0)
        return duration * (steering_moment(orders) / orders->inertia) * orders->yaw_rate_gain;
    return 2.0 * guidance_frequency(orders) * duration;
}

static int32_t noticed(const struct pilot *pilot, bool arrived, const struct leg *leg, double distance,
                       const struct orders *orders, const struct gains *gains, double duration)
{
    const bool drifts = arrived && orders->keep_station == 0;
    int32_t bits = 0;
    if (arrived)
        bits |= ARRIVED;
    if (pilot->missed > 0)
        bits |= MISSED;
    if (!drifts && distance > leg->length + orders->acceptance_radius + 2.0 * gains->lookahead)
        bits |= AWAY;
    if (fabs(pilot->swept) >= 2.0 * PI)
        bits |= CIRCLING;
    if (pilot->saturated > 0.5)
        bits |= SATURATED;
    if (pilot->driven > 0.5)
        bits |= WIND;
    if (step_number(orders, duration) > STEP_LIMIT)
        bits |= LONG_STEP;
    if (guidance_frequency(orders) == 0.0)
        bits |= NOTHING_TO_STEER;
    return bits;
}

/* ---- the law */

struct pilot guidance_beginning(const struct motion *motion)
{
    return (struct pilot){
        .origin = {motion->x, motion->y},
        .heading = motion->heading,
        .x = motion->x,
        .y = motion->y,
        .vx = motion->vx,
        .vy = motion->vy,
    };
}

double guidance_turns(const struct pilot *pilot)
{
    return pilot->swept / (2.0 * PI);
}

void guidance_steer(struct pilot *pilot, const struct motion *motion, const struct course *course,
                    const struct orders *orders, double duration, struct commands *commands, struct sight *sight)
{
    struct way way, to;
    pass_waypoints(pilot, motion, course, orders);
    const struct gains gains = gains_for(orders, duration);
    const bool arrived = pilot->passed >= course->count;
    const struct waypoint *active = &course->points[arrived ? course->count - 1 : pilot->passed];
    const double distance = length_of(active->x - motion->x, active->y - motion->y);
    const struct leg leg = leg_to(arrived ? active : &pilot->origin, active, motion);
    if (arrived)
        way = to_station(active, motion, orders, &gains);
    else
        way = along(&leg, speed_before_corner(&leg, pilot, motion, course, orders, &gains), &gains);
    const struct force lasting = lasting_force(pilot, motion, orders, &gains);
    *commands = (struct commands){0.0, 0.0, 0.0};
    if (guidance_frequency(orders) > 0.0 && (orders->keep_station == 1 || !arrived)) {
        const struct force force = wanted_force(&way, motion, &lasting, orders, &gains);
        const int32_t braking = arrived ? 0 : brakes(pilot, motion, &way, &force, orders, &gains);
        to = arrived ? into_the_wind(motion, &force, orders) : way;
        const double turn = wanted_turn(braking, motion, &to, &force, orders);
        *commands = helm(pilot, motion, &force, turn, orders, &gains, duration);
        pilot->braking = braking;
    }
    if (duration > 0.0) {
        watch(pilot, motion, active, arrived, &way, &lasting, commands, orders, duration);
        learn(pilot, motion, &lasting, commands, orders, &gains, duration);
        pilot->status |= noticed(pilot, arrived, &leg, distance, orders, &gains, duration);
    }
    *sight = (struct sight){leg.cross_track, distance};
}
