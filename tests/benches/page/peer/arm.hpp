// A chain of bodies as a model of Pinocchio.

#pragma once

#include "chain.hpp"

#include <pinocchio/multibody.hpp>

inline pinocchio::JointIndex add_joint(pinocchio::Model &model, pinocchio::JointIndex parent, const Joint &joint,
                                       const pinocchio::SE3 &placement, const std::string &name) {
  switch (joint.slides * 3 + joint.axis) {
  case 0: return model.addJoint(parent, pinocchio::JointModelRX(), placement, name);
  case 1: return model.addJoint(parent, pinocchio::JointModelRY(), placement, name);
  case 2: return model.addJoint(parent, pinocchio::JointModelRZ(), placement, name);
  case 3: return model.addJoint(parent, pinocchio::JointModelPX(), placement, name);
  case 4: return model.addJoint(parent, pinocchio::JointModelPY(), placement, name);
  default: return model.addJoint(parent, pinocchio::JointModelPZ(), placement, name);
  }
}

inline pinocchio::Model model_of(const Chain &chain) {
  pinocchio::Model model;
  model.gravity.linear() << chain.gravity[0], chain.gravity[1], chain.gravity[2];
  std::vector<pinocchio::JointIndex> made;
  for (const Joint &joint : chain.joints) {
    const pinocchio::SE3 placement(Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(joint.rotation),
                                   Eigen::Map<const Eigen::Vector3d>(joint.position));
    const pinocchio::JointIndex parent = joint.parent < 0 ? 0 : made[joint.parent];
    made.push_back(add_joint(model, parent, joint, placement, "q" + std::to_string(made.size() + 1)));
    // M MX MY MZ XX XY XZ YY YZ ZZ of the chain; Pinocchio's order is m, mc, Ixx Ixy Iyy Ixz Iyz Izz.
    const double *p = joint.body;
    Eigen::Matrix<double, 10, 1> v;
    v << p[0], p[1], p[2], p[3], p[4], p[5], p[7], p[6], p[8], p[9];
    // A body without mass has no centre that Pinocchio could keep.
    if (p[0] != 0)
      model.appendBodyToJoint(made.back(), pinocchio::Inertia::FromDynamicParameters(v), pinocchio::SE3::Identity());
  }
  return model;
}
