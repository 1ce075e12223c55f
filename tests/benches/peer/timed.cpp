// Holds a generated `dynamics` against the reference table and times it: nanoseconds per call, the best of many rounds.

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

void dynamics(const double *x, double *tau);

int main(int argc, char **argv) {
  if (argc != 2) return 2;
  std::ifstream file(std::string(argv[1]) + "/pinocchio-panda.csv");
  std::string line;
  std::vector<std::vector<double>> rows;
  std::getline(file, line);
  while (std::getline(file, line)) {
    std::istringstream fields(line);
    std::vector<double> row;
    for (std::string field; std::getline(fields, field, ',');) row.push_back(std::stod(field));
    rows.push_back(row);
  }
  double tau[7], worst = 0, largest = 0;
  for (const auto &row : rows) {
    dynamics(row.data(), tau);
    for (int k = 0; k < 7; ++k) {
      worst = std::max(worst, std::fabs(tau[k] - row[21 + k]));
      largest = std::max(largest, std::fabs(row[21 + k]));
    }
  }
  if (!(worst < 1e-10 * largest)) {
    std::fprintf(stderr, "the torques miss the table by %g of %g\n", worst, largest);
    return 1;
  }
  double best = 1e300;
  for (int round = 0; round < 60; ++round) {
    const int calls = 5000;
    const auto start = std::chrono::steady_clock::now();
    for (int i = 0; i < calls; ++i) {
      dynamics(rows[i % rows.size()].data(), tau);
      __asm__ volatile("" : : "r"(tau) : "memory");
    }
    const std::chrono::duration<double, std::nano> taken = std::chrono::steady_clock::now() - start;
    best = std::min(best, taken.count() / calls);
  }
  std::printf("inverse dynamics\t%.1f\n", best);
}
