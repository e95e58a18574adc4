/* The clocks of one simulated computer: all of them run `rate` times as fast as this machine's, sleeps and timeouts too.

Loaded with LD_PRELOAD. SOAK_CLOCK names the page that all computers share, SOAK_JUMP a file of one double, the seconds by
which this computer's time of day is wrong; both are written by `clock.py` and may change at any moment. Waits are made
of slices, so that a change of the rate counts for those that sleep already. */

#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <pthread.h>
#include <semaphore.h>
#include <stdint.h>
#include <stdlib.h>
#include <sys/epoll.h>
#include <sys/mman.h>
#include <sys/select.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

#define SLICE 0.25 /* real seconds of one wait at most */

/* version is odd while the page is being written. At `real` s of CLOCK_MONOTONIC it was `shown` s; Unix time is `epoch` s
later. */
struct page { volatile uint64_t version; volatile double real, shown, rate, epoch; };

static struct page one = {0, 0.0, 0.0, 1.0, 0.0};
static double right = 0.0;
static struct page *page = &one;
static volatile double *jump = &right;
static __typeof__(&clock_gettime) now_of;
static __typeof__(&clock_nanosleep) real_clock_nanosleep;
static __typeof__(&select) real_select;
static __typeof__(&epoll_wait) real_epoll_wait;
static __typeof__(&pthread_cond_clockwait) real_pthread_cond_clockwait;
static __typeof__(&pthread_cond_timedwait) real_pthread_cond_timedwait;
static __typeof__(&sem_clockwait) real_sem_clockwait;

static void *mapped(const char *variable, size_t size, int *found) {
    const char *file = getenv(variable);
    int descriptor = file ? open(file, O_RDONLY | O_CLOEXEC) : -1;
    void *there = descriptor < 0 ? MAP_FAILED : mmap(NULL, size, PROT_READ, MAP_SHARED, descriptor, 0);
    if (descriptor >= 0) close(descriptor);
    *found = there != MAP_FAILED;
    return there;
}

__attribute__((constructor)) static void begin(void) {
    int found;
    void *there;
    now_of = dlsym(RTLD_NEXT, "clock_gettime");
    real_clock_nanosleep = dlsym(RTLD_NEXT, "clock_nanosleep");
    real_select = dlsym(RTLD_NEXT, "select");
    real_epoll_wait = dlsym(RTLD_NEXT, "epoll_wait");
    real_pthread_cond_clockwait = dlsym(RTLD_NEXT, "pthread_cond_clockwait");
    real_pthread_cond_timedwait = dlvsym(RTLD_NEXT, "pthread_cond_timedwait", "GLIBC_2.3.2");
    if (!real_pthread_cond_timedwait) real_pthread_cond_timedwait = dlsym(RTLD_NEXT, "pthread_cond_timedwait");
    real_sem_clockwait = dlsym(RTLD_NEXT, "sem_clockwait");
    there = mapped("SOAK_CLOCK", sizeof *page, &found);
    if (found) page = there;
    there = mapped("SOAK_JUMP", sizeof *jump, &found);
    if (found) jump = there;
}

static double seconds(const struct timespec *time) { return (double)time->tv_sec + 1e-9 * (double)time->tv_nsec; }

static struct timespec spec(double time) {
    struct timespec found = {(time_t)time, (long)(1e9 * (time - (double)(time_t)time))};
    return found;
}

static double real_now(clockid_t clock) {
    struct timespec time;
    if (!real_sem_clockwait) begin();
    now_of(clock, &time);
    return seconds(&time);
}

static struct page look(void) {
    struct page seen;
    uint64_t before;
    do {
        before = __atomic_load_n(&page->version, __ATOMIC_ACQUIRE);
        seen = *page;
        __atomic_thread_fence(__ATOMIC_ACQUIRE);
    } while (before & 1 || before != page->version);
    return seen;
}

static double shown(void) {
    struct page seen = look();
    return seen.shown + seen.rate * (real_now(CLOCK_MONOTONIC) - seen.real);
}

static double shown_by(clockid_t clock) { return clock == CLOCK_REALTIME ? shown() + page->epoch + *jump : shown(); }

/* Real seconds to wait now for what comes at `until` by the shown clock; 0 if it is over. */
static double slice(double until) {
    double left = (until - shown()) / page->rate;
    return left <= 0.0 ? 0.0 : left < SLICE ? left : SLICE;
}

static int is_shown(clockid_t clock) {
    return clock == CLOCK_REALTIME || clock == CLOCK_REALTIME_COARSE || clock == CLOCK_MONOTONIC ||
           clock == CLOCK_MONOTONIC_COARSE || clock == CLOCK_MONOTONIC_RAW || clock == CLOCK_BOOTTIME;
}

/* ---- what time it is */

int clock_gettime(clockid_t clock, struct timespec *time) {
    if (!real_sem_clockwait) begin();
    if (!is_shown(clock)) return now_of(clock, time);
    *time = spec(shown_by(clock == CLOCK_REALTIME_COARSE ? CLOCK_REALTIME : clock));
    return 0;
}

int gettimeofday(struct timeval *restrict time, void *restrict zone) {
    double now = shown_by(CLOCK_REALTIME);
    (void)zone;
    time->tv_sec = (time_t)now;
    time->tv_usec = (suseconds_t)(1e6 * (now - (double)time->tv_sec));
    return 0;
}

time_t time(time_t *place) {
    time_t now = (time_t)shown_by(CLOCK_REALTIME);
    if (place) *place = now;
    return now;
}

/* ---- sleeping */

static int sleep_until(double until, struct timespec *left) {
    double wait;
    while ((wait = slice(until)) > 0.0) {
        struct timespec some = spec(wait);
        int failed = real_clock_nanosleep(CLOCK_MONOTONIC, 0, &some, NULL);
        if (failed) {
            if (left) *left = spec(until > shown() ? until - shown() : 0.0);
            return failed;
        }
    }
    return 0;
}

int clock_nanosleep(clockid_t clock, int flags, const struct timespec *wanted, struct timespec *left) {
    double until = shown() + seconds(wanted);
    if (!is_shown(clock)) return real_clock_nanosleep(clock, flags, wanted, left);
    if (flags & TIMER_ABSTIME) until = shown() + seconds(wanted) - shown_by(clock);
    return sleep_until(until, flags & TIMER_ABSTIME ? NULL : left);
}

int nanosleep(const struct timespec *wanted, struct timespec *left) {
    int failed = sleep_until(shown() + seconds(wanted), left);
    return failed ? (errno = failed, -1) : 0;
}

int usleep(useconds_t wanted) {
    int failed = sleep_until(shown() + 1e-6 * wanted, NULL);
    return failed ? (errno = failed, -1) : 0;
}

/* ---- waiting for files */

int select(int count, fd_set *in, fd_set *out, fd_set *odd, struct timeval *wanted) {
    fd_set all[3], *sets[3] = {in, out, odd};
    double until, wait;
    int ready, i;
    if (!wanted || (!wanted->tv_sec && !wanted->tv_usec)) return real_select(count, in, out, odd, wanted);
    until = shown() + (double)wanted->tv_sec + 1e-6 * (double)wanted->tv_usec;
    for (i = 0; i < 3; i++)
        if (sets[i]) all[i] = *sets[i];
    do {
        struct timespec some = spec(slice(until));
        struct timeval little = {some.tv_sec, some.tv_nsec / 1000};
        for (i = 0; i < 3; i++)
            if (sets[i]) *sets[i] = all[i];
        ready = real_select(count, in, out, odd, &little);
        wait = slice(until);
    } while (!ready && wait > 0.0);
    return ready;
}

int poll(struct pollfd *files, nfds_t count, int wanted) {
    double until = shown() + 1e-3 * wanted;
    int ready;
    do {
        struct timespec some = spec(wanted > 0 ? slice(until) : 0.0);
        ready = ppoll(files, count, wanted < 0 ? NULL : &some, NULL);
    } while (!ready && slice(until) > 0.0);
    return ready;
}

int epoll_wait(int which, struct epoll_event *events, int most, int wanted) {
    double until = shown() + 1e-3 * wanted;
    int ready;
    if (wanted <= 0) return real_epoll_wait(which, events, most, wanted);
    do {
        ready = real_epoll_wait(which, events, most, (int)(1e3 * slice(until) + 0.999));
    } while (!ready && slice(until) > 0.0);
    return ready;
}

/* ---- waiting for other threads: an end of a slice is a spurious wake-up, which every caller must expect */

static clockid_t clock_of(const struct timespec *until) {
    return until->tv_sec > 100000000 ? CLOCK_REALTIME : CLOCK_MONOTONIC; /* uptimes are shorter than three years */
}

static int woken(int failed, double until) { return failed == ETIMEDOUT && slice(until) > 0.0 ? 0 : failed; }

int pthread_cond_clockwait(pthread_cond_t *one, pthread_mutex_t *lock, clockid_t clock, const struct timespec *wanted) {
    double until = shown() + seconds(wanted) - shown_by(clock);
    struct timespec some = spec(real_now(CLOCK_MONOTONIC) + slice(until));
    return woken(real_pthread_cond_clockwait(one, lock, CLOCK_MONOTONIC, &some), until);
}

int pthread_cond_timedwait(pthread_cond_t *one, pthread_mutex_t *lock, const struct timespec *wanted) {
    clockid_t clock = clock_of(wanted);
    double until = shown() + seconds(wanted) - shown_by(clock);
    struct timespec some = spec(real_now(clock) + slice(until));
    return woken(real_pthread_cond_timedwait(one, lock, &some), until);
}

int sem_clockwait(sem_t *one, clockid_t clock, const struct timespec *wanted) {
    double until = shown() + seconds(wanted) - shown_by(clock);
    int failed;
    do {
        struct timespec some = spec(real_now(CLOCK_MONOTONIC) + slice(until));
        failed = real_sem_clockwait(one, CLOCK_MONOTONIC, &some);
    } while (failed && errno == ETIMEDOUT && slice(until) > 0.0);
    return failed;
}

int sem_timedwait(sem_t *one, const struct timespec *wanted) { return sem_clockwait(one, CLOCK_REALTIME, wanted); }
