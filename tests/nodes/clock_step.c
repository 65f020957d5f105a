/* Copyright 2026 DAMADICS FD maintainers
 * SPDX-License-Identifier: Apache-2.0
 *
 * Preloaded into one process, sets its system clock off by the seconds (a double) in the file
 * CLOCK_STEP_FILE, and lets its waits until a time of that clock last as the kernel would. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <stdlib.h>
#include <time.h>
#include <unistd.h>

#define SLICE 0.05 /* s */
#define YEARS 1000000000 /* s; no machine has been running for so long */

static int (*real_gettime)(clockid_t, struct timespec *);
static int (*real_wait)(pthread_cond_t *, pthread_mutex_t *, const struct timespec *);
static int file = -1;

__attribute__((constructor)) static void begin(void)
{
  const char * path = getenv("CLOCK_STEP_FILE");
  real_gettime = dlsym(RTLD_NEXT, "clock_gettime");
  real_wait = dlvsym(RTLD_NEXT, "pthread_cond_timedwait", "GLIBC_2.3.2");
  if (!real_wait) {
    real_wait = dlsym(RTLD_NEXT, "pthread_cond_timedwait");
  }
  if (path) {
    file = open(path, O_RDONLY | O_CLOEXEC);
  }
}

static double seconds(const struct timespec * time)
{
  return time->tv_sec + 1e-9 * time->tv_nsec;
}

static struct timespec at(double time)
{
  struct timespec result = {(time_t)time, (long)((time - (time_t)time) * 1e9)};
  return result;
}

static double step(void)
{
  double value = 0.0;
  if (file < 0 || pread(file, &value, sizeof value, 0) != sizeof value) {
    return 0.0;
  }
  return value;
}

int clock_gettime(clockid_t clock, struct timespec * time)
{
  int result = real_gettime(clock, time);
  if (result == 0 && clock == CLOCK_REALTIME) {
    *time = at(seconds(time) + step());
  }
  return result;
}

int pthread_cond_timedwait(
  pthread_cond_t * condition, pthread_mutex_t * mutex, const struct timespec * until)
{
  if (until->tv_sec < YEARS) {
    return real_wait(condition, mutex, until); /* of the steady clock */
  }
  for (;;) {
    struct timespec now;
    real_gettime(CLOCK_REALTIME, &now);
    double left = seconds(until) - (seconds(&now) + step());
    if (left <= 0.0) {
      return ETIMEDOUT;
    }
    struct timespec slice = at(seconds(&now) + (left < SLICE ? left : SLICE));
    int result = real_wait(condition, mutex, &slice);
    if (result != ETIMEDOUT) {
      return result;
    }
  }
}
