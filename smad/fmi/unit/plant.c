/* One plant behind the functions of FMI: set, get, start, step. Needs kernel.c before it. */

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>

enum { SAID = 240 };

typedef struct {
    Model model;
    State state;
    Work work;
    double ring[RING_ROWS * RING_COLUMNS];
    double memory[MEMORY_ROWS * MEMORY_COLUMNS + 1];
    double values[INPUTS + OUTPUTS + PARAMETERS]; /* those of outputs are not used */
    bool started;
    char said[SAID]; /* the last refusal */
} Plant;

static bool refuse(Plant *plant, const char *format, ...) {
    va_list given;
    va_start(given, format);
    vsnprintf(plant->said, SAID, format, given);
    va_end(given);
    return false;
}

static const Limits *limits_of(size_t reference) {
    if (reference < INPUTS) return &LIMITS[reference];
    if (reference < FIRST_PARAMETER || reference >= FIRST_PARAMETER + PARAMETERS) return NULL;
    return &LIMITS[reference - OUTPUTS];
}

static void plant_reset(Plant *plant) {
    memset(plant, 0, sizeof *plant);
    for (size_t n = 0; n < INPUTS + OUTPUTS + PARAMETERS; n++) {
        const Limits *limits = limits_of(n);
        if (limits) plant->values[n] = limits->start;
    }
}

static bool plant_set(Plant *plant, size_t reference, double value) {
    const Limits *limits = limits_of(reference);
    if (!limits) return refuse(plant, "variable %zu is an output or unknown; set inputs and parameters", reference);
    if (!isfinite(value)) return refuse(plant, "%s is not finite; got %g; set a finite number", limits->name, value);
    if (value < limits->low || value > limits->high) {
        if (isinf(limits->high))
            return refuse(plant, "%s is out of range; got %g; allowed: at least %g", limits->name, value, limits->low);
        return refuse(plant, "%s is out of range; got %g; allowed: %g to %g", limits->name, value, limits->low, limits->high);
    }
    if (reference >= FIRST_PARAMETER && plant->started && value != plant->values[reference])
        return refuse(plant, "parameter %s cannot be changed while the unit runs; got %g; set it before initialisation ends", limits->name, value);
    plant->values[reference] = value;
    return true;
}

static Table table_of(double *at, long rows, long columns) {
    return (Table){at, rows, columns};
}

static bool plant_start(Plant *plant) {
    if (plant->started) return true;
    const double *v = &plant->values[FIRST_PARAMETER];
    for (size_t n = 0; n < sizeof ORDERS / sizeof ORDERS[0]; n++)
        if (!(v[ORDERS[n][0]] < v[ORDERS[n][1]]))
            return refuse(plant, "parameter %s must be below %s; change one of them",
                          LIMITS[INPUTS + ORDERS[n][0]].name, LIMITS[INPUTS + ORDERS[n][1]].name);
    Mounting mount;
    memcpy(&plant->model, MODEL, sizeof plant->model);
    make_constants(v, &plant->model.p, &mount);
    if (!(mount.xi_S >= 0.0 && mount.xi_S <= 1.0))
        return refuse(plant, "initial_force and initial_deflection do not fit the moduli: Eq. (10) gives %g, outside 0 to 1", mount.xi_S);
    if (UNIFIED) k_lay_curves(&plant->model);
    mount.T_x = mount.T_y = plant->values[STARTS_AT];
    mount.T_inlet = plant->values[INLET];
    mount.T_air = plant->values[AMBIENT];
    memset(&plant->state, 0, sizeof plant->state);
    memset(&plant->work, 0, sizeof plant->work);
    plant->work.forces = HAS_LAWS;
    Table ring = table_of(plant->ring, RING_ROWS, RING_COLUMNS);
    k_rest(&plant->state, &plant->model, &mount, ring);
    /* The first sample, as a replay has it. */
    k_wake_sensors(&plant->state, &plant->model, ring);
    if (HAS_LAWS)
        k_force_readings(&plant->state, &plant->work, table_of(LAWS, LAWS_ROWS, LAWS_COLUMNS),
                         table_of(plant->memory, MEMORY_ROWS, MEMORY_COLUMNS), 0.0);
    plant->started = true;
    return true;
}

static bool plant_step(Plant *plant, double duration) {
    if (!plant_start(plant)) return false;
    if (!(duration > 0.0 && isfinite(duration))) return refuse(plant, "a step of %g s; it needs a positive finite duration", duration);
    double count = ceil(duration / MAX_STEP - 1e-9);
    if (count > 1e9) return refuse(plant, "a step of %g s is too long; make it %g s at most", duration, 1e9 * MAX_STEP);
    long steps = count > 1.0 ? (long)count : 1;
    const double *v = plant->values;
    Driven *drive = &plant->work.drive;
    drive->i_x = v[0];
    drive->i_y = v[1];
    drive->duty_x = v[2];
    drive->duty_y = v[3];
    drive->drain_x = v[4] >= 0.5;
    drive->drain_y = v[5] >= 0.5;
    drive->stage = v[6];
    plant->state.shared.given_inlet = v[INLET];
    plant->state.shared.given_air = v[AMBIENT];
    long status = k_advance(&plant->state, &plant->work, &plant->model,
                            table_of(plant->ring, RING_ROWS, RING_COLUMNS), table_of(FILM, FILM_ROWS, FILM_COLUMNS),
                            table_of(LAWS, LAWS_ROWS, LAWS_COLUMNS), table_of(plant->memory, MEMORY_ROWS, MEMORY_COLUMNS),
                            duration / (double)steps, steps);
    if (status == 0) return true;
    return refuse(plant, "%s at %g s: wire at %g and %g K, force %g N",
                  status == 1 ? "the equilibrium of temperature, fractions and force was not found" : "the state is no longer finite",
                  plant->state.shared.time, plant->state.x.T_wire, plant->state.y.T_wire, plant->state.shared.tension);
}

static bool plant_get(Plant *plant, size_t reference, double *value) {
    if (reference == INPUTS + OUTPUTS + PARAMETERS) {
        *value = plant->started ? plant->state.shared.time : 0.0; /* the independent variable */
        return true;
    }
    if (limits_of(reference)) {
        *value = plant->values[reference];
        return true;
    }
    if (reference > INPUTS + OUTPUTS) return refuse(plant, "variable %zu is unknown", reference);
    if (!plant_start(plant)) return false;
    *value = ((double *)&plant->state)[OUTPUT_PLACE[reference - INPUTS]] - OUTPUT_OFF[reference - INPUTS];
    return true;
}
