// Holds a generated `dynamics` against the torques of a chain and times it: nanoseconds per call, the best of many rounds.

#include "chain.hpp"

#include <cmath>

void dynamics(const double *x, double *tau);

int main(int argc, char **argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: timed <chain>\n");
    return 2;
  }
  const Chain chain = read_chain(argv[1]);
  const size_t n = chain.joints.size(), states = chain.states.size();
  std::vector<double> tau(n);
  double worst = 0, largest = 0;
  for (const auto &row : chain.states) {
    dynamics(row.data(), tau.data());
    for (size_t k = 0; k < n; ++k) {
      worst = std::max(worst, std::fabs(tau[k] - row[3 * n + k]));
      largest = std::max(largest, std::fabs(row[3 * n + k]));
    }
  }
  if (!agrees(worst, largest)) return 1;
  std::printf("inverse dynamics\t%.2f\n", nanoseconds([&](int i) {
    dynamics(chain.states[i % states].data(), tau.data());
    __asm__ volatile("" : : "r"(tau.data()) : "memory");
  }));
}
