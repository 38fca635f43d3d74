// The halvings of halve.wgsl in C, on the forms that the shaders get, for a picture that every
// solid covers: the yardstick of the cost of a halving.  Loops over LANES pixels become vector code.

#include <pthread.h>
#include <stdint.h>
#include <string.h>

enum { LANES = 128, MOST_THREADS = 256 };

typedef struct {
  float a[6], g[6], c[6];  // of 1, x, y, x², xy, y²
  float depth_middle, depth_half;
  int32_t center_x, center_y;
} Solid;

typedef struct {
  const Solid *solids;
  int32_t count, width, first_row, end_row, steps;
  int32_t *nearest;  // index of the nearest solid of each pixel, -1 for none
} Band;

static inline float quadratic(const float *form, float x, float y) {
  return form[0] + (x * form[1] + y * form[2]) + ((x * form[3] + y * form[4]) * x + y * y * form[5]);
}

static void try_solid(const Solid *solid, int32_t number, int32_t steps, int32_t i, int32_t j,
                      float *depth, int32_t *nearest) {
  float double_a[LANES], g[LANES], double_g[LANES], double_c[LANES], v[LANES];
  int32_t hit[LANES];
  float y = (float)(j - solid->center_y);
  for (int l = 0; l < LANES; l++) {
    float x = (float)(i + l - solid->center_x);
    float a = quadratic(solid->a, x, y), c = quadratic(solid->c, x, y);
    g[l] = quadratic(solid->g, x, y);
    hit[l] = g[l] * g[l] >= 4 * (a * c);
    double_a[l] = a + a;
    double_g[l] = g[l] + g[l];
    double_c[l] = c + c;
    v[l] = 0;
  }
  float step = 1;
  for (int k = 0; k < steps; k++) {
    step *= 0.5f;
    for (int l = 0; l < LANES; l++) {
      float slope = double_a[l] * v[l] + double_g[l];
      float double_f = slope * v[l] + double_c[l];
      v[l] += (double_f > 0) & (slope < g[l]) ? step : -step;
    }
  }
  for (int l = 0; l < LANES; l++) {
    float found = solid->depth_middle + v[l] * solid->depth_half;
    int32_t nearer = hit[l] & (found < depth[l]);
    depth[l] = nearer ? found : depth[l];
    nearest[l] = nearer ? number : nearest[l];
  }
}

static void *render_band(void *argument) {
  const Band *band = argument;
  for (int32_t j = band->first_row; j < band->end_row; j++)
    for (int32_t i = 0; i < band->width; i += LANES) {
      float depth[LANES];
      int32_t nearest[LANES];
      for (int l = 0; l < LANES; l++) depth[l] = 3e38f, nearest[l] = -1;
      for (int32_t k = 0; k < band->count; k++)
        try_solid(&band->solids[k], k, band->steps, i, j, depth, nearest);
      memcpy(band->nearest + (int64_t)j * band->width + i, nearest, sizeof nearest);
    }
  return 0;
}

// Renders a picture; its width is a multiple of LANES.  Returns 0, or 1 if a thread cannot start.
int render(const Solid *solids, int32_t count, int32_t width, int32_t height, int32_t steps,
           int32_t threads, int32_t *nearest) {
  pthread_t ids[MOST_THREADS];
  Band bands[MOST_THREADS];
  int started = 0;
  if (threads > MOST_THREADS) threads = MOST_THREADS;
  for (; started < threads; started++) {
    int64_t first = (int64_t)height * started / threads, end = (int64_t)height * (started + 1) / threads;
    bands[started] = (Band){solids, count, width, (int32_t)first, (int32_t)end, steps, nearest};
    if (pthread_create(&ids[started], 0, render_band, &bands[started])) break;
  }
  for (int k = 0; k < started; k++) pthread_join(ids[k], 0);
  return started < threads;
}
