/* Tables of numbers for tests. */

#include "check.h"

/* Reads rows of numbers behind a line of names. */
static void read_table(const char *folder, const char *name, double *to, size_t rows, size_t columns) {
  static char path[4096], line[65536];
  size_t i, k;
  FILE *file;
  snprintf(path, sizeof path, "%s/%s", folder, name);
  file = fopen(path, "r");
  if (!file || !fgets(line, sizeof line, file)) {
    fprintf(stderr, "%s cannot be read\n", path);
    exit(1);
  }
  for (i = 0; i < rows; ++i) {
    char *next = fgets(line, sizeof line, file);
    for (k = 0; next && k < columns; ++k, ++next) *to++ = strtod(next, &next);
  }
  fclose(file);
}
