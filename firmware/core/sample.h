/* One sample: from the chip's codes to measurements, and to what the host is told of it. */

#ifndef SMAD_SAMPLE_H
#define SMAD_SAMPLE_H

#include "smad_protocol.h"
#include "smad_supervisor.h"

struct sample {
    int64_t t_us;
    uint16_t tick;
    int32_t encoder_counts;
    int32_t force_counts;
    uint8_t sp_seq; /* of the setpoint in use */
    uint16_t sp_age_us;
    struct smad_sv_measurements measured;
};

/* Reads everything; what was applied meanwhile is in `sv`. */
void sample_read(struct sample *s, const struct smad_sv_memory *sv);

/* Fills in STATE. */
void sample_tell(const struct sample *s, const struct smad_sv_memory *sv,
                 struct smad_state *state);

#endif
