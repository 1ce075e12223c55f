// A chain of bodies with states and torques, as benches/page/chain.rs writes it; how calls are timed; what is close enough.

#pragma once

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <string>
#include <vector>

struct Joint {
  int parent;         // -1 for the base
  int slides, axis;   // 0: turns, 1: slides; 0, 1, 2: x, y, z
  double rotation[9], position[3]; // of the joint in its parent, by rows
  double body[10];    // M MX MY MZ XX XY XZ YY YZ ZZ about the joint's origin
};

struct Chain {
  double gravity[3];
  std::vector<Joint> joints;
  std::vector<std::vector<double>> states; // q, q', q'', torques
};

inline Chain read_chain(const std::string &path) {
  std::ifstream file(path);
  Chain chain;
  size_t joints = 0, states = 0;
  file >> joints >> states;
  for (double &g : chain.gravity) file >> g;
  chain.joints.resize(joints);
  for (Joint &joint : chain.joints) {
    file >> joint.parent >> joint.slides >> joint.axis;
    for (double &x : joint.rotation) file >> x;
    for (double &x : joint.position) file >> x;
    for (double &x : joint.body) file >> x;
  }
  chain.states.assign(states, std::vector<double>(4 * joints));
  for (auto &row : chain.states)
    for (double &x : row) file >> x;
  if (!file || joints == 0 || states == 0) {
    std::fprintf(stderr, "%s is no chain\n", path.c_str());
    std::exit(2);
  }
  return chain;
}

// Nanoseconds per call, the best of many rounds.
template <typename F>
double nanoseconds(F &&call) {
  double best = 1e300;
  for (int round = 0; round < 40; ++round) {
    const int calls = 1000;
    const auto start = std::chrono::steady_clock::now();
    for (int i = 0; i < calls; ++i) call(i);
    const std::chrono::duration<double, std::nano> taken = std::chrono::steady_clock::now() - start;
    best = std::min(best, taken.count() / calls);
  }
  return best;
}

inline bool agrees(double worst, double largest) {
  if (worst <= 1e-10 * largest) return true;
  std::fprintf(stderr, "the torques differ by %g of %g\n", worst, largest);
  return false;
}
