/* What a plant and an emulated board tell each other, one SOCK_SEQPACKET message each way.
 *
 * The plant sends a time step, what the pins show from now on, and the bytes that arrive at the
 * serial port; the board runs exactly that long and answers with what its pins do and the bytes it
 * sent. Little-endian; the records are followed by `size` bytes. sim_device/firmware/link.py has
 * the same two records. */

#ifndef SMAD_LINK_H
#define SMAD_LINK_H

#include <stdint.h>

#define LINK_BYTES 4096u
#define LINK_WATCHED 4u
#define LINK_NOINIT 4u

struct link_in {
    uint32_t dt_us;
    uint32_t stall_us; /* the loop hangs for so long, from the beginning of the step */
    uint16_t analog[8]; /* codes of the converter, 0 to 1023, in the order of enum hal_analog */
    uint16_t rtd[4];
    int32_t bridge;
    int32_t encoder;
    uint32_t tacho_us[2];
    uint8_t inputs;
    uint8_t deaf; /* interrupts do not run meanwhile either */
    uint16_t size;
};

struct link_out {
    uint64_t t_us; /* of the chip's clock, not wrapped */
    uint16_t current_mA[2];
    uint8_t pump[2];
    uint8_t gate;
    uint8_t drain;
    uint16_t resets; /* of the watchdog, since power-up */
    uint16_t size;
    uint32_t sample_cycles; /* of an emulated chip: the longest sample that ended in this step */
    uint32_t watched[LINK_WATCHED]; /* of an emulated chip: its memory where --watch says */
    uint32_t noinit[LINK_NOINIT]; /* what outlives a reset: hal_noinit */
};

/* A whole message each way. */
struct link_to_board {
    struct link_in head;
    uint8_t bytes[LINK_BYTES];
};

struct link_from_board {
    struct link_out head;
    uint8_t bytes[LINK_BYTES];
};

#endif
