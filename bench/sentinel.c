/* How late a real-time thread wakes on this machine, beside whatever else runs.
 *
 * sentinel SECONDS PRIORITY CORE    wakes 1000 times a second on an absolute grid and prints one
 *                                   line of JSON with percentiles (us) of its lateness. */

#define _GNU_SOURCE
#include <errno.h>
#include <sched.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <time.h>

#define PERIOD_NS 1000000L
#define CAPACITY 1000000

static long late_ns[CAPACITY];

static int by_size(const void *a, const void *b)
{
    long x = *(const long *)a, y = *(const long *)b;
    return (x > y) - (x < y);
}

int main(int count, char **argument)
{
    if (count != 4) {
        fprintf(stderr, "usage: sentinel SECONDS PRIORITY CORE\n");
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
        late_ns[taken++] = (now.tv_sec - due.tv_sec) * 1000000000L + now.tv_nsec - due.tv_nsec;
    }
    qsort(late_ns, (size_t)taken, sizeof late_ns[0], by_size);
    printf("{\"samples\": %ld, \"p50_us\": %.2f, \"p99_us\": %.2f, \"p999_us\": %.2f}\n", taken,
           (double)late_ns[taken / 2] / 1e3, (double)late_ns[taken * 99 / 100] / 1e3,
           (double)late_ns[taken * 999 / 1000] / 1e3);
    return 0;
}
