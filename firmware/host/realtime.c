/* In place of a bench there are two resistors of 1 ohm with an RTD on each, as in the checklist of
 * first power (docs/firmware-wiring.md): they warm, nothing moves. */

#define _GNU_SOURCE
#include "realtime.h"

#include "hal.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

#define LATE_MOST_US 50000u
#define ROOM_degC 25.0
#define LOAD_ohm 1.0
#define LOAD_J_PER_K 3.0
#define LOAD_W_PER_K 0.15
#define SUPPLY_CODE 614u /* 12 V */
#define CODES_PER_A 204.8
#define CODES_PER_V 68.27
#define PULSE_RPM_US 30000000u
#define FULL_RPM 6000u

static int master = -1;
static const char *name;
static uint64_t clock_us;
static double load_degC[2] = {ROOM_degC, ROOM_degC};
static uint32_t noise = 1;

static void fail(const char *what)
{
    fprintf(stderr, "smad-firmware-host: %s: %s\n", what, strerror(errno));
    exit(1);
}

static uint64_t wall_us(void)
{
    struct timespec t;
    (void)clock_gettime(CLOCK_MONOTONIC, &t);
    return (uint64_t)t.tv_sec * 1000000u + (uint64_t)t.tv_nsec / 1000u;
}

static void end(int number)
{
    (void)number;
    (void)unlink(name);
    _exit(0);
}

void realtime_open(const char *symlink_name)
{
    struct termios raw;
    int slave;
    name = symlink_name;
    master = posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK);
    if (master < 0 || grantpt(master) != 0 || unlockpt(master) != 0) {
        fail("no pseudo-terminal");
    }
    /* Held open: without a slave reading gives EIO while no host is there. */
    slave = open(ptsname(master), O_RDWR | O_NOCTTY);
    if (slave < 0 || tcgetattr(slave, &raw) != 0) {
        fail(ptsname(master));
    }
    cfmakeraw(&raw);
    (void)tcsetattr(slave, TCSANOW, &raw);
    (void)unlink(name);
    if (symlink(ptsname(master), name) != 0) {
        fail(name);
    }
    (void)signal(SIGTERM, end);
    (void)signal(SIGINT, end);
    printf("ready: %s\n", ptsname(master));
    (void)fflush(stdout);
    clock_us = wall_us();
}

/* The register of an RTD converter, with half a code of noise as a real one has. */
static uint16_t rtd(double degC)
{
    double ohm = 100.0 * (1.0 + 3.9083e-3 * degC - 5.775e-7 * degC * degC);
    noise = noise * 1664525u + 1013904223u;
    return (uint16_t)((uint16_t)(ohm / 430.0 * 32768.0 + (noise >> 31)) << 1);
}

static void warm(const struct link_out *out, double dt_s, struct link_in *in)
{
    for (int k = 0; k < 2; k++) {
        double i_A = out->gate ? out->current_mA[k] * 1e-3 : 0.0;
        uint32_t rpm = FULL_RPM * out->pump[k] / 255u;
        load_degC[k] += (i_A * i_A * LOAD_ohm - (load_degC[k] - ROOM_degC) * LOAD_W_PER_K) * dt_s
                        / LOAD_J_PER_K;
        in->analog[HAL_I_X + k] = (uint16_t)(i_A * CODES_PER_A + 0.5);
        in->analog[HAL_V_X + k] = (uint16_t)(i_A * LOAD_ohm * CODES_PER_V + 0.5);
        in->rtd[k] = rtd(load_degC[k]);
        in->rtd[2 + k] = rtd(ROOM_degC);
        in->tacho_us[k] = rpm > 0 ? PULSE_RPM_US / rpm : 0;
    }
    in->analog[HAL_VBUS] = SUPPLY_CODE;
}

void realtime_step(const struct link_out *out, const uint8_t *sent, struct link_to_board *in,
                   uint64_t wait_us)
{
    struct pollfd port = {.fd = master, .events = POLLIN};
    uint64_t late_us = wall_us() - clock_us;
    uint64_t now_us;
    ssize_t size;
    uint64_t left_us = late_us < wait_us ? wait_us - late_us : 0;
    struct timespec left = {.tv_sec = (time_t)(left_us / 1000000u),
                            .tv_nsec = (long)(left_us % 1000000u) * 1000};
    if (out->size > 0 && write(master, sent, out->size) < 0 && errno != EAGAIN) {
        fail("cannot write to the port");
    }
    (void)ppoll(&port, 1, &left, NULL);
    now_us = wall_us();
    memset(&in->head, 0, sizeof in->head);
    size = read(master, in->bytes, LINK_BYTES / 4u);
    in->head.size = size > 0 ? (uint16_t)size : 0;
    if (now_us - clock_us > LATE_MOST_US) {
        /* The computer kept the process from running. A chip's clock cannot: time stood still. */
        clock_us = now_us - wait_us;
    }
    in->head.dt_us = (uint32_t)(now_us - clock_us);
    clock_us = now_us;
    warm(out, in->head.dt_us * 1e-6, &in->head);
}
