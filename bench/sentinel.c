/* How late a real-time thread wakes on this machine, beside whatever else runs.
 *
 * sentinel SECONDS PRIORITY CORE FILE    wakes 1000 times a second on an absolute grid and writes
 *                                        to FILE, for each time, two 64-bit numbers: when it was
 *                                        due (ns, monotonic clock), and how late it was. */

#define _GNU_SOURCE
#include <errno.h>
#include <sched.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <time.h>

#define PERIOD_NS 1000000L
#define CAPACITY 1000000

static int64_t times_ns[2 * CAPACITY];

int main(int count, char **argument)
{
    if (count != 5) {
        fprintf(stderr, "usage: sentinel SECONDS PRIORITY CORE FILE\n");
        return 2;
    }
    long wanted = (long)(atof(argument[1]) * 1000), taken = 0;
    struct sched_param parameters = {.sched_priority = atoi(argument[2])};
    cpu_set_t cores;
    CPU_ZERO(&cores);
    CPU_SET(atoi(argument[3]), &cores);
    sched_setaffinity(0, sizeof cores, &cores);
    if (parameters.sched_priority > 0 && sched_setscheduler(0, SCHED_FIFO, &parameters) != 0)
        fprintf(stderr, "sentinel: no real-time scheduling: %s\n", strerror(errno));
    mlockall(MCL_CURRENT | MCL_FUTURE);
    prctl(PR_SET_TIMERSLACK, 1UL);
    struct timespec due, now;
    clock_gettime(CLOCK_MONOTONIC, &due);
    while (taken < wanted && taken < CAPACITY) {
        due.tv_nsec += PERIOD_NS;
        if (due.tv_nsec >= 1000000000L) {
            due.tv_nsec -= 1000000000L;
            due.tv_sec++;
        }
        clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &due, NULL);
        clock_gettime(CLOCK_MONOTONIC, &now);
        times_ns[2 * taken] = due.tv_sec * 1000000000LL + due.tv_nsec;
        times_ns[2 * taken + 1] = now.tv_sec * 1000000000LL + now.tv_nsec - times_ns[2 * taken];
        taken++;
    }
    FILE *file = fopen(argument[4], "wb");
    if (file == NULL || fwrite(times_ns, 16, (size_t)taken, file) != (size_t)taken ||
        fclose(file) != 0) {
        fprintf(stderr, "sentinel: cannot write %s: %s\n", argument[4], strerror(errno));
        return 1;
    }
    return 0;
}
