// Pinocchio's inverse dynamics of a chain of bodies as C code, by way of CasADi; prints how many milliseconds of processor
// time it took.

// CasADi's support comes before everything else of Pinocchio.
#include <pinocchio/autodiff/casadi.hpp>

#include "arm.hpp"

#include <pinocchio/algorithm/rnea.hpp>

#include <ctime>

int main(int argc, char **argv) {
  if (argc != 3) {
    std::fprintf(stderr, "usage: by_pinocchio <chain> <file>\n");
    return 2;
  }
  using casadi::SX;
  const Chain chain = read_chain(argv[1]);
  const std::clock_t start = std::clock();
  const pinocchio::ModelTpl<SX> model = model_of(chain).cast<SX>();
  pinocchio::DataTpl<SX> data(model);
  const int n = model.nv;
  const SX x = SX::sym("x", 3 * n);
  using Vector = Eigen::Matrix<SX, Eigen::Dynamic, 1>;
  Vector q(n), v(n), a(n);
  for (int i = 0; i < n; ++i) q[i] = x(i), v[i] = x(n + i), a[i] = x(2 * n + i);
  pinocchio::rnea(model, data, q, v, a);
  SX tau(n, 1);
  for (int i = 0; i < n; ++i) tau(i) = data.tau[i];
  const casadi::Function function("chain_torques", std::vector<SX>{x}, std::vector<SX>{cse(tau)});
  casadi::CodeGenerator generator("code", casadi::Dict{{"with_header", false}, {"main", false}});
  generator.add(function);
  const std::string code = generator.dump();
  const double taken = 1e3 * double(std::clock() - start) / CLOCKS_PER_SEC;
  std::ofstream(argv[2]) << "extern \"C\" {\n" << code << "\n}\n"
    << "void dynamics(const double *x, double *tau) {\n"
       "  const double *in[1] = {x}; double *out[1] = {tau}; chain_torques(in, out, 0, 0, 0);\n}\n";
  std::printf("%.1f\n", taken);
}
