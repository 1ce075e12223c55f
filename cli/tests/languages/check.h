/* What ends a test. */

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

static void check(int good, const char *what) {
  if (!good) {
    fprintf(stderr, "%s\n", what);
    exit(1);
  }
}
