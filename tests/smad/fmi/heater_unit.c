/* The heater of heater_unit.py as another program would export it: compiled, without Python. */
#include <stddef.h>
#include <stdlib.h>

typedef unsigned int reference;
enum { POWER, EXTRA, CAPACITY, LOSS, ROOM, TEMPERATURE, COUNT };
static const double starts[COUNT] = {0.0, 0.0, 30.0, 0.8, 22.0, 22.0};

static void begin(double *v) {
    for (int i = 0; i < COUNT; i++) v[i] = starts[i];
}

const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }

void *fmi2Instantiate(const char *name, int kind, const char *guid, const char *resources,
                      const void *callbacks, int visible, int logging) {
    double *v = malloc(sizeof starts);
    if (v) begin(v);
    return v;
}
void fmi2FreeInstance(void *c) { free(c); }
int fmi2SetupExperiment(void *c, int tolerant, double tolerance, double start, int stops,
                        double stop) { return 0; }
int fmi2EnterInitializationMode(void *c) { return 0; }
int fmi2ExitInitializationMode(void *c) {
    double *v = c;
    v[TEMPERATURE] = v[ROOM];
    return 0;
}
int fmi2Terminate(void *c) { return 0; }
int fmi2Reset(void *c) { begin(c); return 0; }
int fmi2GetReal(void *c, const reference r[], size_t n, double out[]) {
    for (size_t i = 0; i < n; i++) out[i] = ((double *)c)[r[i]];
    return 0;
}
int fmi2SetReal(void *c, const reference r[], size_t n, const double in[]) {
    for (size_t i = 0; i < n; i++) ((double *)c)[r[i]] = in[i];
    return 0;
}
int fmi2DoStep(void *c, double now, double step, int forward) {
    double *v = c;
    double given = v[POWER] + v[EXTRA] - v[LOSS] * (v[TEMPERATURE] - v[ROOM]);
    v[TEMPERATURE] += step * given / v[CAPACITY];
    return v[TEMPERATURE] < 1e4 ? 0 : 2;
}

/* What every unit must offer and this one never needs: "discard". */
#define NOT_NEEDED(name) int fmi2##name(void) { return 2; }
NOT_NEEDED(SetDebugLogging)
NOT_NEEDED(GetInteger)
NOT_NEEDED(GetBoolean)
NOT_NEEDED(GetString)
NOT_NEEDED(SetInteger)
NOT_NEEDED(SetBoolean)
NOT_NEEDED(SetString)
NOT_NEEDED(GetFMUstate)
NOT_NEEDED(SetFMUstate)
NOT_NEEDED(FreeFMUstate)
NOT_NEEDED(SerializedFMUstateSize)
NOT_NEEDED(SerializeFMUstate)
NOT_NEEDED(DeSerializeFMUstate)
NOT_NEEDED(GetDirectionalDerivative)
NOT_NEEDED(SetRealInputDerivatives)
NOT_NEEDED(GetRealOutputDerivatives)
NOT_NEEDED(CancelStep)
NOT_NEEDED(GetStatus)
NOT_NEEDED(GetRealStatus)
NOT_NEEDED(GetIntegerStatus)
NOT_NEEDED(GetBooleanStatus)
NOT_NEEDED(GetStringStatus)
