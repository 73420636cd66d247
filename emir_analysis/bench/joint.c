/* Joint 1's integrated model without effects, in plain C: the same equations, state for state and
 * term for term, as emir_plant/core.py with every effect off, and the same Runge-Kutta method.
 * A yardstick for the speed of the compiled Python, nothing else; a test holds both together. */

#include <math.h>

enum { N = 5 };                               /* modes */
enum { P_H, P_S, SPOOL, SPOOL_RATE, LOGIC, MODES, SIZE = MODES + 2 * N };

typedef struct {
    double area_lifting, area_lowering, volume_lifting_0, volume_lowering_0, beta;
    double relief_pressure, relief_slope, p0, pT;
    double flow_nominal, flow_ratio_lowering, natural_frequency, balance_pressure, dead_zone, damping;
    double k_pump_line, k_block_in, k_return_line, k_block_out;
    double k_meter_out_lifting, k_meter_out_lowering;
    double threshold, time_constant_opening, time_constant_closing, pilot;
    double triangle_a, triangle_b, triangle_gamma0;
    double mode_joint[N], mode_weight[N], mode_stiffness[N], mode_damping[N];
} Machine;

static double turbulent_flow(double drop, double conductance) {
    return conductance * drop / sqrt(sqrt(drop * drop + 1e5 * 1e5));
}

static double pump_flow(double opening, double nominal, double pressure, const Machine *p) {
    double wanted = fabs(opening) * nominal, lines = p->k_pump_line + p->k_block_in;
    double conductance = wanted / sqrt(lines * wanted * wanted + p->balance_pressure);
    return fmax(0.0, fmin(wanted, turbulent_flow(p->p0 - pressure, conductance)));
}

static double opening(double spool, const Machine *p) {
    double beyond = fabs(spool) - p->dead_zone;
    return beyond <= 0.0 ? 0.0 : copysign(beyond / (1.0 - p->dead_zone), spool);
}

static void flows(const double *x, const Machine *p, double *lifting, double *lowering) {
    double o = opening(x[SPOOL], p), o2 = o * o;
    *lifting = *lowering = 0.0;
    if (o > 0.0) {
        *lifting = pump_flow(o, p->flow_nominal, x[P_H], p);
        *lowering = -turbulent_flow(
            x[P_S] - p->pT, o / sqrt(p->k_meter_out_lifting + p->k_return_line * o2));
    } else if (o < 0.0) {
        double block = x[LOGIC] * x[LOGIC];
        double k = p->k_meter_out_lowering * block + p->k_return_line * o2 * block
                   + p->k_block_out * o2;
        *lifting = -turbulent_flow(x[P_H] - p->pT, -o * x[LOGIC] / sqrt(k));
        *lowering = pump_flow(o, p->flow_nominal * p->flow_ratio_lowering, x[P_S], p);
    }
}

static double pressure_rate(double surplus, double volume, double pressure, const Machine *p) {
    double rate = surplus * p->beta / volume;
    return pressure <= 0.0 ? fmax(rate, 0.0) : rate;
}

static double relief_flow(double pressure, const Machine *p) {
    return p->relief_slope * fmax(pressure - p->relief_pressure, 0.0);
}

static double cylinder_length(double angle, const Machine *p) {
    double a = p->triangle_a, b = p->triangle_b;
    return sqrt(a * a + b * b - 2.0 * a * b * cos(angle + p->triangle_gamma0));
}

void rates(const double *x, double command, const Machine *p, double *dx) {
    const double *q = x + MODES, *v = q + N;
    double angle = 0.0, joint_rate = 0.0, lifting, lowering;
    for (int i = 0; i < N; i++) {
        angle += p->mode_joint[i] * q[i];
        joint_rate += p->mode_joint[i] * v[i];
    }
    double length = cylinder_length(angle, p);
    double arm = p->triangle_a * p->triangle_b * sin(angle + p->triangle_gamma0) / length;
    double stroke = length - cylinder_length(0.0, p), velocity = arm * joint_rate;
    double torque = (x[P_H] * p->area_lifting - x[P_S] * p->area_lowering) * arm;

    flows(x, p, &lifting, &lowering);
    lifting -= relief_flow(x[P_H], p) + p->area_lifting * velocity;
    lowering -= relief_flow(x[P_S], p) - p->area_lowering * velocity;
    dx[P_H] = pressure_rate(
        lifting, p->volume_lifting_0 + p->area_lifting * stroke, x[P_H], p);
    dx[P_S] = pressure_rate(
        lowering, p->volume_lowering_0 - p->area_lowering * stroke, x[P_S], p);

    double w = p->natural_frequency, pilot = p->pilot == 0.0 ? x[P_H] : x[P_S];
    dx[SPOOL] = x[SPOOL_RATE];
    dx[SPOOL_RATE] = w * w * (command - x[SPOOL]) - 2.0 * p->damping * w * x[SPOOL_RATE];
    dx[LOGIC] = pilot > p->threshold ? (1.0 - x[LOGIC]) / p->time_constant_opening
                                     : -x[LOGIC] / p->time_constant_closing;
    double gravity = cos(angle);
    for (int i = 0; i < N; i++) {
        dx[MODES + i] = v[i];
        dx[MODES + N + i] = p->mode_joint[i] * torque - p->mode_weight[i] * gravity
                            - p->mode_stiffness[i] * q[i] - p->mode_damping[i] * v[i];
    }
}

static void step(double *x, double command, double h, const Machine *p) {
    double k1[SIZE], k2[SIZE], k3[SIZE], k4[SIZE], between[SIZE];
    rates(x, command, p, k1);
    for (int i = 0; i < SIZE; i++) between[i] = x[i] + 0.5 * h * k1[i];
    rates(between, command, p, k2);
    for (int i = 0; i < SIZE; i++) between[i] = x[i] + 0.5 * h * k2[i];
    rates(between, command, p, k3);
    for (int i = 0; i < SIZE; i++) between[i] = x[i] + h * k3[i];
    rates(between, command, p, k4);
    for (int i = 0; i < SIZE; i++) x[i] += h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]);
    x[P_H] = fmax(x[P_H], 0.0);
    x[P_S] = fmax(x[P_S], 0.0);
}

/* Runs k commands, each held for `steps` steps of h, s; states: (k + 1, SIZE), the first given. */
void simulate(double *states, const double *commands, int k, int steps, double h,
              const Machine *p) {
    for (int c = 0; c < k; c++) {
        double *x = states + (c + 1) * SIZE;
        for (int i = 0; i < SIZE; i++) x[i] = x[i - SIZE];
        for (int s = 0; s < steps; s++) step(x, commands[c], h, p);
    }
}
