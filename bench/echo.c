/* The least a host can do, for comparison with the daemon: it answers each STATE with a SETPOINT.
 *
 * echo PORT SECONDS PRIORITY FILE    PORT is a tty, or fd:N for an inherited socket; priority 0 is
 *                                     ordinary scheduling, else SCHED_FIFO with locked memory.
 *
 * Prints one line of JSON: samples and missed. Writes to FILE, for each sample after the first
 * second, two 64-bit numbers: when its STATE had been read (ns, monotonic clock), and how long
 * after that its SETPOINT had been written. */

#define _GNU_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <sched.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

#include "smad_protocol.h"

#define CAPACITY 1000000
#define SETTLING_NS 1000000000LL
#define HELLO_EVERY_NS 200000000LL
#define TTL_MS 100

static int64_t times_ns[2 * CAPACITY];
static size_t taken;

static int64_t now_ns(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return t.tv_sec * 1000000000LL + t.tv_nsec;
}

static int open_port(const char *name)
{
    if (strncmp(name, "fd:", 3) == 0)
        return atoi(name + 3);
    int fd = open(name, O_RDWR | O_NOCTTY | O_NONBLOCK);
    if (fd < 0)
        return -1;
    struct termios line;
    tcgetattr(fd, &line);
    cfmakeraw(&line);
    line.c_cc[VMIN] = 1;
    tcsetattr(fd, TCSANOW, &line);
    return fd;
}

static void real_time(int priority)
{
    if (priority <= 0)
        return;
    struct sched_param wanted = {.sched_priority = priority};
    if (sched_setscheduler(0, SCHED_FIFO, &wanted) != 0 || mlockall(MCL_CURRENT | MCL_FUTURE) != 0)
        fprintf(stderr, "echo: no real-time scheduling: %s\n", strerror(errno));
    prctl(PR_SET_TIMERSLACK, 1UL);
}

static void say_hello(int fd)
{
    struct smad_hello hello = {SMAD_PROTOCOL_MAJOR, SMAD_PROTOCOL_MINOR, SMAD_SCHEMA_CRC, 7};
    uint8_t payload[SMAD_HELLO_SIZE], wire[SMAD_MAX_WIRE + 1] = {0};
    smad_pack_hello(&hello, payload);
    size_t size = smad_frame_encode(SMAD_HELLO_NUMBER, 0, 0, payload, sizeof payload, wire + 1);
    if (write(fd, wire, size + 1) < 0)
        fprintf(stderr, "echo: %s\n", strerror(errno));
}

static void answer(int fd, const struct smad_state *state, uint16_t session)
{
    static uint8_t seq;
    struct smad_setpoint setpoint = {.t_ref_us = state->t_us, .ttl_ms = TTL_MS};
    uint8_t payload[SMAD_SETPOINT_SIZE], wire[SMAD_MAX_WIRE];
    smad_pack_setpoint(&setpoint, payload);
    size_t size = smad_frame_encode(SMAD_SETPOINT_NUMBER, ++seq, session, payload,
                                    sizeof payload, wire);
    if (write(fd, wire, size) < 0 && errno != EAGAIN)
        fprintf(stderr, "echo: %s\n", strerror(errno));
}

int main(int count, char **argument)
{
    if (count != 5) {
        fprintf(stderr, "usage: echo PORT SECONDS PRIORITY FILE\n");
        return 2;
    }
    int fd = open_port(argument[1]);
    if (fd < 0) {
        fprintf(stderr, "echo: cannot open %s: %s\n", argument[1], strerror(errno));
        return 1;
    }
    real_time(atoi(argument[3]));
    int64_t begin = now_ns(), end = begin + (int64_t)(atof(argument[2]) * 1e9), hello_due = begin;
    struct smad_decoder decoder;
    smad_decoder_init(&decoder);
    uint16_t session = 0, last_tick = 0;
    long samples = 0, missed = 0;
    struct pollfd waited = {.fd = fd, .events = POLLIN};
    while (now_ns() < end) {
        if (session == 0 && now_ns() >= hello_due) {
            say_hello(fd);
            hello_due = now_ns() + HELLO_EVERY_NS;
        }
        if (poll(&waited, 1, 50) <= 0)
            continue;
        uint8_t data[4096];
        ssize_t size = read(fd, data, sizeof data);
        if (size <= 0)
            continue;
        int64_t read_at = now_ns();
        struct smad_state newest;
        bool fresh = false;
        for (ssize_t i = 0; i < size; i++) {
            struct smad_frame frame;
            struct smad_ident ident;
            if (!smad_decoder_byte(&decoder, data[i], &frame))
                continue;
            if (frame.type == SMAD_IDENT_NUMBER && session == 0 &&
                smad_unpack_ident(&ident, frame.payload, frame.size) && ident.nonce == 7)
                session = ident.session;
            if (frame.type == SMAD_STATE_NUMBER && session != 0 &&
                smad_unpack_state(&newest, frame.payload, frame.size)) {
                if (samples++ > 0)
                    missed += (uint16_t)(newest.tick - last_tick - 1);
                last_tick = newest.tick;
                fresh = true;
            }
        }
        if (!fresh)
            continue;
        answer(fd, &newest, session);
        int64_t written_at = now_ns();
        if (written_at - begin > SETTLING_NS && taken < CAPACITY) {
            times_ns[2 * taken] = read_at;
            times_ns[2 * taken++ + 1] = written_at - read_at;
        }
    }
    FILE *file = fopen(argument[4], "wb");
    if (file == NULL || fwrite(times_ns, 16, taken, file) != taken || fclose(file) != 0) {
        fprintf(stderr, "echo: cannot write %s: %s\n", argument[4], strerror(errno));
        return 1;
    }
    printf("{\"samples\": %ld, \"missed\": %ld}\n", samples, missed);
    return samples > 0 ? 0 : 1;
}
