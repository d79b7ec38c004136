// A controller manager whose mock hardware is a simulated arm: effort commands move it, positions
// and velocities are its own, efforts have noise. See track_controller.py.
//
// The libraries of the hardware are there without their headers, so what is called is declared
// here. `read` of the mock hardware is defined here too: that of the program is taken before that
// of the library.
#define main main_of_ros2_control_node
#include "ros2_control_node.cpp"
#undef main

#include <sched.h>

#include <cmath>
#include <cstdio>
#include <random>

#include "arm_dynamics.h"

namespace hardware_interface
{
enum class return_type : std::uint8_t { OK = 0 };
class HardwareComponentInterface
{
public:
  template <typename T>
  void set_state(const std::string & name, const T & value);
  template <typename T>
  T get_command(const std::string & name) const;
};
}  // namespace hardware_interface

namespace mock_components
{
class GenericSystem : public hardware_interface::HardwareComponentInterface
{
public:
  hardware_interface::return_type read(const rclcpp::Time &, const rclcpp::Duration &);
};
}  // namespace mock_components

namespace
{
constexpr int N = ARM_JOINTS;
constexpr int kSteps = 8;  // of a cycle
constexpr double kStep = 0.002 / kSteps;
constexpr double kSlope = 20.0;  // above the steepest slope of friction [N m s/rad]: taken implicitly

constexpr double kNoise = 0.05;  // of efforts that are measured [N m]

double q[N] = {0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785}, dq[N];
std::string names[N];

void solve(double (*M)[N], double * x)
{
  for (int k = 0; k < N; k++) {
    for (int i = k + 1; i < N; i++) {
      const double factor = M[i][k] / M[k][k];
      for (int j = k; j < N; j++) M[i][j] -= factor * M[k][j];
      x[i] -= factor * x[k];
    }
  }
  for (int k = N - 1; k >= 0; k--) {
    for (int j = k + 1; j < N; j++) x[k] -= M[k][j] * x[j];
    x[k] /= M[k][k];
  }
}

void advance(const double * tau)
{
  double M[N][N], bias[N], zero[N] = {}, ddq[N];
  arm_inertia_matrix(q, &M[0][0]);
  arm_torque(q, dq, zero, bias);
  for (int i = 0; i < N; i++) {
    ddq[i] = tau[i] - bias[i];
    M[i][i] += kStep * kSlope;
  }
  solve(M, ddq);
  for (int i = 0; i < N; i++) {
    dq[i] += kStep * ddq[i];
    q[i] += kStep * dq[i];
  }
}
}  // namespace

hardware_interface::return_type mock_components::GenericSystem::read(
  const rclcpp::Time &, const rclcpp::Duration &)
{
  static std::mt19937 random;
  static std::normal_distribution<double> noise(0.0, kNoise);
  double tau[N];
  bool commanded = true;  // brakes hold the arm before
  for (int i = 0; i < N; i++) {
    tau[i] = get_command<double>(names[i] + "/effort");
    commanded = commanded && std::isfinite(tau[i]);
  }
  for (int k = 0; commanded && k < kSteps; k++) advance(tau);
  for (int i = 0; i < N; i++) {
    set_state(names[i] + "/position", q[i]);
    set_state(names[i] + "/velocity", dq[i]);
    if (commanded) set_state(names[i] + "/effort", tau[i] + noise(random));
  }
  return hardware_interface::return_type::OK;
}

int main(int count, char ** arguments)
{
  for (int i = 0; i < N; i++) names[i] = "panda_joint" + std::to_string(i + 1);
  auto & manager = made(count, arguments);
  // controllers read the clock: a late cycle is an error of the arm, so be as punctual as allowed
  sched_param parameters{};
  parameters.sched_priority = 50;
  if (sched_setscheduler(0, SCHED_FIFO, &parameters)) std::perror("no real-time priority");
  run(manager);
  services.join();
  std::_Exit(0);
}
