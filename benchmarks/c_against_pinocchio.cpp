/*
 * Times single calls at random states: the exported header against pinocchio, in turns.
 *
 *   program BLOCKS <joints
 *
 * reads gravity, and for each joint of pinocchio's model its rotation (by columns), translation and
 * the ten dynamic parameters of its body;
 * prints nanoseconds per call for each block (header, pinocchio) and last the largest difference
 * of the links' torques over the largest torque.
 */
#include "arm.h"

#include <pinocchio/algorithm/rnea.hpp>

#include <chrono>
#include <cstdlib>
#include <iostream>
#include <random>
#include <string>
#include <vector>

namespace
{
constexpr int STATES = 1000;
constexpr int ROUNDS = 20;

struct State
{
  Eigen::VectorXd q, dq, ddq;
};

std::vector<State> random_states()
{
  std::mt19937 random(0);
  std::uniform_real_distribution<double> draw(-1.0, 1.0);
  const auto vector = [&] { return Eigen::VectorXd::NullaryExpr(ARM_JOINTS, [&] { return draw(random); }); };
  std::vector<State> states(STATES);
  for (State & x : states) x = {vector(), vector(), vector()};
  return states;
}

pinocchio::Model read_model()
{
  pinocchio::Model model;
  for (double & x : model.gravity.linear()) std::cin >> x;
  pinocchio::JointIndex last = 0;
  for (int i = 0; i < ARM_JOINTS; i++) {
    Eigen::Matrix3d rotation;
    Eigen::Vector3d translation;
    Eigen::Matrix<double, 10, 1> body;
    for (double & x : rotation.reshaped()) std::cin >> x;
    for (double & x : translation) std::cin >> x;
    for (double & x : body) std::cin >> x;
    const pinocchio::SE3 place(rotation, translation);
    last = model.addJoint(last, pinocchio::JointModelRZ(), place, "joint" + std::to_string(i));
    model.appendBodyToJoint(last, pinocchio::Inertia::FromDynamicParameters(body), pinocchio::SE3::Identity());
  }
  return model;
}

volatile double sink;

/* Nanoseconds per call over all states, several times. */
template <typename Call>
double timed(const std::vector<State> & states, Call call)
{
  double sum = 0.0;
  const auto begin = std::chrono::steady_clock::now();
  for (int round = 0; round < ROUNDS; round++)
    for (const State & x : states) sum += call(x);
  const std::chrono::duration<double, std::nano> passed = std::chrono::steady_clock::now() - begin;
  sink = sum;
  return passed.count() / (ROUNDS * STATES);
}
}  // namespace

int main(int, char ** arguments)
{
  const pinocchio::Model model = read_model();
  pinocchio::Data data(model);
  const std::vector<State> states = random_states();

  const auto header = [](const State & x) {
    double tau[ARM_JOINTS], kinetic, potential;
    arm_dynamics(x.q.data(), x.dq.data(), x.ddq.data(), tau, &kinetic, &potential);
    return tau[0] + kinetic + potential;
  };
  const auto rnea = [&](const State & x) { return pinocchio::rnea(model, data, x.q, x.dq, x.ddq)[0]; };
  timed(states, header);
  timed(states, rnea);
  for (int block = 0; block < std::atoi(arguments[1]); block++)
    std::cout << timed(states, header) << ' ' << timed(states, rnea) << '\n';

  double difference = 0.0, largest = 0.0;
  for (const State & x : states) {
    Eigen::VectorXd tau(ARM_JOINTS);
    double kinetic, potential;
    arm_links_torque(x.q.data(), x.dq.data(), x.ddq.data(), tau.data(), &kinetic, &potential);
    const Eigen::VectorXd expected = pinocchio::rnea(model, data, x.q, x.dq, x.ddq);
    difference = std::max(difference, (tau - expected).cwiseAbs().maxCoeff());
    largest = std::max(largest, expected.cwiseAbs().maxCoeff());
  }
  std::cout << difference / largest << '\n';
}
