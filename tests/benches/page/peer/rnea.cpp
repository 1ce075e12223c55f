// Times Pinocchio's inverse dynamics and its joint torque regressor on a chain of bodies, for comparison with emitted code.
//
// Reads the chain with its states and torques as benches/page/chain.rs writes it, checks its own torques against them, and
// prints nanoseconds per call, of RNEA and of the regressor (one column for each of the ten parameters of each body).

#include "arm.hpp"

#include <pinocchio/algorithm/regressor.hpp>
#include <pinocchio/algorithm/rnea.hpp>

int main(int argc, char **argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: rnea <chain>\n");
    return 2;
  }
  const Chain chain = read_chain(argv[1]);
  const int n = static_cast<int>(chain.joints.size());
  const pinocchio::Model model = model_of(chain);
  pinocchio::Data data(model);

  std::vector<Eigen::VectorXd> q, v, a;
  double worst = 0, largest = 0;
  for (const auto &row : chain.states) {
    q.push_back(Eigen::Map<const Eigen::VectorXd>(&row[0], n));
    v.push_back(Eigen::Map<const Eigen::VectorXd>(&row[n], n));
    a.push_back(Eigen::Map<const Eigen::VectorXd>(&row[2 * n], n));
    const Eigen::VectorXd expected = Eigen::Map<const Eigen::VectorXd>(&row[3 * n], n);
    worst = std::max(worst, (pinocchio::rnea(model, data, q.back(), v.back(), a.back()) - expected).cwiseAbs().maxCoeff());
    largest = std::max(largest, expected.cwiseAbs().maxCoeff());
  }
  if (!agrees(worst, largest)) return 1;

  const int states = static_cast<int>(q.size());
  double sink = 0;
  std::printf("inverse dynamics\t%.2f\n", nanoseconds([&](int i) {
    sink += pinocchio::rnea(model, data, q[i % states], v[i % states], a[i % states])[0];
  }));
  std::printf("regressor\t%.2f\n", nanoseconds([&](int i) {
    sink += pinocchio::computeJointTorqueRegressor(model, data, q[i % states], v[i % states], a[i % states])(0, 0);
  }));
  return sink == 0.125;
}
