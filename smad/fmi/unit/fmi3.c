/* The plant as a unit of FMI 3.0 for co-simulation. One translation unit, C11, libm only. */

#include "kernel.c"
#include "plant.c"
#include "token.h"

#include <stdint.h>

#if defined _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

typedef enum { OK, WARNING, DISCARD, ERROR, FATAL } Status;
typedef uint32_t Reference;
typedef void (*LogMessage)(void *environment, Status status, const char *category, const char *message);

typedef struct {
    Plant plant;
    LogMessage log;
    void *environment;
} Instance;

static Status answer(Instance *instance, bool done) {
    if (done) return OK;
    if (instance->log) instance->log(instance->environment, ERROR, "logStatusError", instance->plant.said);
    return ERROR;
}

EXPORT const char *fmi3GetVersion(void) { return "3.0"; }

EXPORT Instance *fmi3InstantiateCoSimulation(
    const char *name, const char *token, const char *resources, bool visible, bool logging, bool event_mode,
    bool early_return, const Reference *intermediate, size_t count, void *environment, LogMessage log, void *update) {
    (void)name, (void)resources, (void)visible, (void)logging, (void)event_mode, (void)early_return;
    (void)intermediate, (void)count, (void)update;
    if (!token || strcmp(token, TOKEN)) {
        if (log) log(environment, ERROR, "logStatusError", "the token is not that of modelDescription.xml");
        return NULL;
    }
    Instance *instance = calloc(1, sizeof *instance);
    if (!instance) return NULL;
    instance->log = log;
    instance->environment = environment;
    plant_reset(&instance->plant);
    return instance;
}

EXPORT void fmi3FreeInstance(Instance *instance) { free(instance); }

EXPORT Status fmi3EnterInitializationMode(Instance *instance, bool tolerant, double tolerance, double start, bool stops, double stop) {
    (void)instance, (void)tolerant, (void)tolerance, (void)start, (void)stops, (void)stop;
    return OK;
}

EXPORT Status fmi3ExitInitializationMode(Instance *instance) { return answer(instance, plant_start(&instance->plant)); }

EXPORT Status fmi3Terminate(Instance *instance) { return (void)instance, OK; }

EXPORT Status fmi3Reset(Instance *instance) { return plant_reset(&instance->plant), OK; }

EXPORT Status fmi3SetDebugLogging(Instance *instance, bool on, size_t count, const char *const categories[]) {
    return (void)instance, (void)on, (void)count, (void)categories, OK;
}

EXPORT Status fmi3SetFloat64(Instance *instance, const Reference *at, size_t count, const double *values, size_t n) {
    if (count != n) return ERROR;
    for (size_t i = 0; i < count; i++)
        if (!plant_set(&instance->plant, at[i], values[i])) return answer(instance, false);
    return OK;
}

EXPORT Status fmi3GetFloat64(Instance *instance, const Reference *at, size_t count, double *values, size_t n) {
    if (count != n) return ERROR;
    for (size_t i = 0; i < count; i++)
        if (!plant_get(&instance->plant, at[i], &values[i])) return answer(instance, false);
    return OK;
}

EXPORT Status fmi3DoStep(Instance *instance, double now, double step, bool no_return, bool *event, bool *terminate,
                         bool *early, double *last) {
    (void)no_return;
    *event = *terminate = *early = false;
    bool done = plant_step(&instance->plant, step);
    *last = done ? now + step : now;
    return answer(instance, done);
}

EXPORT Status fmi3GetFMUState(Instance *instance, Plant **kept) {
    if (!*kept) *kept = malloc(sizeof **kept);
    if (!*kept) return ERROR;
    **kept = instance->plant;
    return OK;
}

EXPORT Status fmi3SetFMUState(Instance *instance, const Plant *kept) { return instance->plant = *kept, OK; }

EXPORT Status fmi3FreeFMUState(Instance *instance, Plant **kept) {
    (void)instance;
    free(*kept);
    *kept = NULL;
    return OK;
}

EXPORT Status fmi3SerializedFMUStateSize(Instance *instance, const Plant *kept, size_t *size) {
    return (void)instance, (void)kept, *size = sizeof *kept, OK;
}

EXPORT Status fmi3SerializeFMUState(Instance *instance, const Plant *kept, unsigned char bytes[], size_t size) {
    (void)instance;
    if (size < sizeof *kept) return ERROR;
    memcpy(bytes, kept, sizeof *kept);
    return OK;
}

EXPORT Status fmi3DeserializeFMUState(Instance *instance, const unsigned char bytes[], size_t size, Plant **kept) {
    if (size != sizeof(Plant)) return ERROR;
    if (fmi3GetFMUState(instance, kept) != OK) return ERROR;
    memcpy(*kept, bytes, sizeof(Plant));
    return OK;
}

/* No variable of another type: nothing to read or write is no error. */
#define NO_VARIABLES(type)                                                                             \
    EXPORT Status fmi3Get##type(Instance *i, const Reference *at, size_t count, void *v, size_t n) {   \
        return (void)i, (void)at, (void)v, (void)n, count ? ERROR : OK;                                \
    }                                                                                                  \
    EXPORT Status fmi3Set##type(Instance *i, const Reference *at, size_t count, void *v, size_t n) {   \
        return (void)i, (void)at, (void)v, (void)n, count ? ERROR : OK;                                \
    }
NO_VARIABLES(Float32)
NO_VARIABLES(Int8)
NO_VARIABLES(UInt8)
NO_VARIABLES(Int16)
NO_VARIABLES(UInt16)
NO_VARIABLES(Int32)
NO_VARIABLES(UInt32)
NO_VARIABLES(Int64)
NO_VARIABLES(UInt64)
NO_VARIABLES(Boolean)
NO_VARIABLES(String)

EXPORT Status fmi3GetBinary(Instance *i, const Reference *at, size_t count, size_t *sizes, void *v, size_t n) {
    return (void)i, (void)at, (void)sizes, (void)v, (void)n, count ? ERROR : OK;
}
EXPORT Status fmi3SetBinary(Instance *i, const Reference *at, size_t count, const size_t *sizes, void *v, size_t n) {
    return (void)i, (void)at, (void)sizes, (void)v, (void)n, count ? ERROR : OK;
}

/* Functions that a unit without clocks, events, derivatives and model exchange refuses. */
#define REFUSED(name) \
    EXPORT Status fmi3##name(void) { return ERROR; }
#define NOT_MADE(name) \
    EXPORT Instance *fmi3Instantiate##name(void) { return NULL; }
NOT_MADE(ModelExchange)
NOT_MADE(ScheduledExecution)
REFUSED(EnterEventMode)
REFUSED(GetClock)
REFUSED(SetClock)
REFUSED(GetNumberOfVariableDependencies)
REFUSED(GetVariableDependencies)
REFUSED(GetDirectionalDerivative)
REFUSED(GetAdjointDerivative)
REFUSED(EnterConfigurationMode)
REFUSED(ExitConfigurationMode)
REFUSED(GetIntervalDecimal)
REFUSED(GetIntervalFraction)
REFUSED(GetShiftDecimal)
REFUSED(GetShiftFraction)
REFUSED(SetIntervalDecimal)
REFUSED(SetIntervalFraction)
REFUSED(SetShiftDecimal)
REFUSED(SetShiftFraction)
REFUSED(EvaluateDiscreteStates)
REFUSED(UpdateDiscreteStates)
REFUSED(EnterContinuousTimeMode)
REFUSED(CompletedIntegratorStep)
REFUSED(SetTime)
REFUSED(SetContinuousStates)
REFUSED(GetContinuousStateDerivatives)
REFUSED(GetEventIndicators)
REFUSED(GetContinuousStates)
REFUSED(GetNominalsOfContinuousStates)
REFUSED(GetNumberOfEventIndicators)
REFUSED(GetNumberOfContinuousStates)
REFUSED(EnterStepMode)
REFUSED(GetOutputDerivatives)
REFUSED(ActivateModelPartition)
