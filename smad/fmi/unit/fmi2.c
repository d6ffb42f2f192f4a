/* The plant as a unit of FMI 2.0 for co-simulation. One translation unit, C11, libm only. */

#include "kernel.c"
#include "plant.c"
#include "token.h"

#if defined _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

typedef enum { OK, WARNING, DISCARD, ERROR, FATAL, PENDING } Status;
typedef unsigned Reference;
typedef void (*Logger)(void *environment, const char *name, Status status, const char *category, const char *message, ...);
typedef struct {
    Logger logger;
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*finished)(void *, Status);
    void *environment;
} Callbacks;

typedef struct {
    Plant plant;
    Logger log;
    void *environment;
    char name[64];
} Instance;

static Status answer(Instance *instance, bool done) {
    if (done) return OK;
    /* A format for printf, says FMI; importers in other languages show it as it is. No % is in it. */
    if (instance->log)
        instance->log(instance->environment, instance->name, ERROR, "logStatusError", instance->plant.said);
    return ERROR;
}

EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }
EXPORT const char *fmi2GetVersion(void) { return "2.0"; }

EXPORT Instance *fmi2Instantiate(const char *name, int type, const char *token, const char *resources,
                                 const Callbacks *callbacks, int visible, int logging) {
    (void)resources, (void)visible, (void)logging;
    Logger log = callbacks ? callbacks->logger : NULL;
    if (type != 1 || !token || strcmp(token, TOKEN)) {
        if (log)
            log(callbacks->environment, name, ERROR, "logStatusError",
                type != 1 ? "the unit is for co-simulation only" : "the token is not that of modelDescription.xml");
        return NULL;
    }
    Instance *instance = calloc(1, sizeof *instance);
    if (!instance) return NULL;
    instance->log = log;
    instance->environment = callbacks ? callbacks->environment : NULL;
    snprintf(instance->name, sizeof instance->name, "%s", name ? name : "");
    plant_reset(&instance->plant);
    return instance;
}

EXPORT void fmi2FreeInstance(Instance *instance) { free(instance); }

EXPORT Status fmi2SetupExperiment(Instance *instance, int tolerant, double tolerance, double start, int stops, double stop) {
    return (void)instance, (void)tolerant, (void)tolerance, (void)start, (void)stops, (void)stop, OK;
}

EXPORT Status fmi2EnterInitializationMode(Instance *instance) { return (void)instance, OK; }
EXPORT Status fmi2ExitInitializationMode(Instance *instance) { return answer(instance, plant_start(&instance->plant)); }
EXPORT Status fmi2Terminate(Instance *instance) { return (void)instance, OK; }
EXPORT Status fmi2Reset(Instance *instance) { return plant_reset(&instance->plant), OK; }

EXPORT Status fmi2SetDebugLogging(Instance *instance, int on, size_t count, const char *const categories[]) {
    return (void)instance, (void)on, (void)count, (void)categories, OK;
}

EXPORT Status fmi2SetReal(Instance *instance, const Reference *at, size_t count, const double *values) {
    for (size_t i = 0; i < count; i++)
        if (!plant_set(&instance->plant, at[i], values[i])) return answer(instance, false);
    return OK;
}

EXPORT Status fmi2GetReal(Instance *instance, const Reference *at, size_t count, double *values) {
    for (size_t i = 0; i < count; i++)
        if (!plant_get(&instance->plant, at[i], &values[i])) return answer(instance, false);
    return OK;
}

EXPORT Status fmi2DoStep(Instance *instance, double now, double step, int no_return) {
    (void)now, (void)no_return;
    return answer(instance, plant_step(&instance->plant, step));
}

EXPORT Status fmi2GetFMUstate(Instance *instance, Plant **kept) {
    if (!*kept) *kept = malloc(sizeof **kept);
    if (!*kept) return ERROR;
    **kept = instance->plant;
    return OK;
}

EXPORT Status fmi2SetFMUstate(Instance *instance, const Plant *kept) { return instance->plant = *kept, OK; }

EXPORT Status fmi2FreeFMUstate(Instance *instance, Plant **kept) {
    (void)instance;
    free(*kept);
    *kept = NULL;
    return OK;
}

EXPORT Status fmi2SerializedFMUstateSize(Instance *instance, const Plant *kept, size_t *size) {
    return (void)instance, (void)kept, *size = sizeof *kept, OK;
}

EXPORT Status fmi2SerializeFMUstate(Instance *instance, const Plant *kept, char bytes[], size_t size) {
    (void)instance;
    if (size < sizeof *kept) return ERROR;
    memcpy(bytes, kept, sizeof *kept);
    return OK;
}

EXPORT Status fmi2DeSerializeFMUstate(Instance *instance, const char bytes[], size_t size, Plant **kept) {
    if (size != sizeof(Plant)) return ERROR;
    if (fmi2GetFMUstate(instance, kept) != OK) return ERROR;
    memcpy(*kept, bytes, sizeof(Plant));
    return OK;
}

/* No variable of another type: nothing to read or write is no error. */
#define NO_VARIABLES(type)                                                                  \
    EXPORT Status fmi2Get##type(Instance *i, const Reference *at, size_t count, void *v) {  \
        return (void)i, (void)at, (void)v, count ? ERROR : OK;                              \
    }                                                                                       \
    EXPORT Status fmi2Set##type(Instance *i, const Reference *at, size_t count, void *v) {  \
        return (void)i, (void)at, (void)v, count ? ERROR : OK;                              \
    }
NO_VARIABLES(Integer)
NO_VARIABLES(Boolean)
NO_VARIABLES(String)

/* Functions that a unit without derivatives and pending steps refuses. */
#define REFUSED(name) \
    EXPORT Status fmi2##name(void) { return ERROR; }
REFUSED(GetDirectionalDerivative)
REFUSED(SetRealInputDerivatives)
REFUSED(GetRealOutputDerivatives)
REFUSED(CancelStep)
REFUSED(GetStatus)
REFUSED(GetRealStatus)
REFUSED(GetIntegerStatus)
REFUSED(GetBooleanStatus)
REFUSED(GetStringStatus)
