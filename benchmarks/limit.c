// Copyright 2026 dsse_ros maintainers
// SPDX-License-Identifier: Apache-2.0
/* Limit of any batch that writes its maps: as many bytes, written by memset. Each thread has its share of the maps and
   writes it again and again. gcc -O3 -march=native limit.c -o limit -lpthread
   usage: limit GRID BATCH SECS THREADS */
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

static double seconds;

typedef struct {
  char *bytes;
  size_t count;
  double rate; /* times per second */
} Share;

static double now(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return t.tv_sec + 1e-9 * t.tv_nsec;
}

static void *write_share(void *argument) {
  Share *share = argument;
  long times = 0;
  double start = now(), elapsed;
  do {
    memset(share->bytes, times & 1, share->count);
    /* The compiler must not leave out what nobody reads. */
    __asm__ volatile("" : : "r"(share->bytes) : "memory");
    times++;
    elapsed = now() - start;
  } while (elapsed < seconds);
  share->rate = times / elapsed;
  return NULL;
}

int main(int count, char **values) {
  if (count != 5) return 2;
  size_t grid = atol(values[1]), batch = atol(values[2]), threads = atol(values[4]);
  seconds = atof(values[3]);
  size_t bytes = batch * grid * grid * sizeof(float);
  char *maps = malloc(bytes);
  pthread_t *running = malloc(threads * sizeof *running);
  Share *shares = malloc(threads * sizeof *shares);
  if (!maps || !running || !shares) return 1;
  memset(maps, 1, bytes);
  for (size_t i = 0; i < threads; i++) {
    size_t first = bytes * i / threads, last = bytes * (i + 1) / threads;
    shares[i] = (Share){maps + first, last - first, 0};
    if (pthread_create(&running[i], NULL, write_share, &shares[i])) return 1;
  }
  double maps_per_s = 0;
  for (size_t i = 0; i < threads; i++) {
    pthread_join(running[i], NULL);
    maps_per_s += shares[i].rate * shares[i].count / bytes * batch;
  }
  printf("memset grid %zu batch %zu threads %zu: %.0f maps/s\n", grid, batch, threads, maps_per_s);
}
