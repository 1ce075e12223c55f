// Times Pinocchio's inverse dynamics and its joint torque regressor on the arm of this folder's reference table, for
// comparison with the emitted code.
//
// Reads the table of states that `fixtures/reference/make_pinocchio_tables.py` wrote, checks its own torques against it,
// and prints nanoseconds per call, of RNEA and of the regressor (7x70). It is built and run by benches/peers.rs.

#include <pinocchio/algorithm/regressor.hpp>
#include <pinocchio/algorithm/rnea.hpp>
#include <pinocchio/multibody.hpp>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

static std::vector<std::vector<double>> read(const std::string &path) {
  std::ifstream file(path);
  std::string line;
  std::vector<std::vector<double>> rows;
  std::getline(file, line);
  while (std::getline(file, line)) {
    std::istringstream fields(line);
    std::vector<double> row;
    for (std::string field; std::getline(fields, field, ',');) row.push_back(std::stod(field));
    rows.push_back(row);
  }
  return rows;
}

// The Franka Panda by modified Denavit-Hartenberg, as in model-spec/models/panda.toml: a, alpha / (pi/2), d.
static const double DH[7][3] = {{0, 0, 0.333},       {0, -1, 0},    {0, 1, 0.316}, {0.0825, 1, 0},
                                {-0.0825, -1, 0.384}, {0, 1, 0},    {0.088, 1, 0}};

template <typename F>
static double nanoseconds(F &&call) {
  double best = 1e300;
  for (int round = 0; round < 20; ++round) {
    const int calls = 2000;
    const auto start = std::chrono::steady_clock::now();
    for (int i = 0; i < calls; ++i) call(i);
    const std::chrono::duration<double, std::nano> taken = std::chrono::steady_clock::now() - start;
    best = std::min(best, taken.count() / calls);
  }
  return best;
}

int main(int argc, char **argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: rnea <folder of reference tables>\n");
    return 2;
  }
  const std::string folder = argv[1];
  const auto parameters = read(folder + "/pinocchio-panda-parameters.csv").at(0);
  const auto rows = read(folder + "/pinocchio-panda.csv");

  pinocchio::Model model;
  model.gravity.linear() << 0, 0, -9.81;
  pinocchio::JointIndex parent = 0;
  for (int i = 0; i < 7; ++i) {
    const double a = DH[i][0], alpha = DH[i][1] * M_PI / 2, d = DH[i][2];
    const Eigen::Matrix3d turn = Eigen::AngleAxisd(alpha, Eigen::Vector3d::UnitX()).toRotationMatrix();
    const pinocchio::SE3 placement(turn, Eigen::Vector3d(a, 0, 0) + turn * Eigen::Vector3d(0, 0, d));
    parent = model.addJoint(parent, pinocchio::JointModelRZ(), placement, "q" + std::to_string(i + 1));
    // XX XY XZ YY YZ ZZ MX MY MZ M of the table; Pinocchio's order is m, mc, Ixx Ixy Iyy Ixz Iyz Izz.
    const double *p = &parameters[10 * i];
    Eigen::Matrix<double, 10, 1> v;
    v << p[9], p[6], p[7], p[8], p[0], p[1], p[3], p[2], p[4], p[5];
    model.appendBodyToJoint(parent, pinocchio::Inertia::FromDynamicParameters(v), pinocchio::SE3::Identity());
  }
  pinocchio::Data data(model);

  std::vector<Eigen::VectorXd> q, v, a;
  double worst = 0, largest = 0;
  for (const auto &row : rows) {
    q.push_back(Eigen::Map<const Eigen::VectorXd>(&row[0], 7));
    v.push_back(Eigen::Map<const Eigen::VectorXd>(&row[7], 7));
    a.push_back(Eigen::Map<const Eigen::VectorXd>(&row[14], 7));
    const Eigen::VectorXd expected = Eigen::Map<const Eigen::VectorXd>(&row[21], 7);
    worst = std::max(worst, (pinocchio::rnea(model, data, q.back(), v.back(), a.back()) - expected).cwiseAbs().maxCoeff());
    largest = std::max(largest, expected.cwiseAbs().maxCoeff());
  }
  if (!(worst < 1e-10 * largest)) {
    std::fprintf(stderr, "the torques miss the table by %g of %g\n", worst, largest);
    return 1;
  }

  const int n = static_cast<int>(q.size());
  double sink = 0;
  const double rnea = nanoseconds([&](int i) {
    sink += pinocchio::rnea(model, data, q[i % n], v[i % n], a[i % n])[0];
  });
  const double regressor = nanoseconds([&](int i) {
    sink += pinocchio::computeJointTorqueRegressor(model, data, q[i % n], v[i % n], a[i % n])(0, 0);
  });
  std::printf("inverse dynamics\t%.1f\n", rnea);
  std::printf("regressor\t%.1f\n", regressor);
  return sink == 0.125;
}
