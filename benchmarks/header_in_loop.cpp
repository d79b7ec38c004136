// The exported header in the loop of a controller manager: when each cycle begins, how long the
// controllers take in it, and how long the header. See header_in_loop.py.
//
// header_in_loop FOLDER CYCLES CORE PRIORITY --ros-args ...: measures once FOLDER/begin exists, and
// writes FOLDER/cycles, 64-bit integers in nanoseconds: late, controllers, header (-1: not called).
#define main main_of_ros2_control_node
#include "ros2_control_node.cpp"
#undef main

#include <sched.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <vector>

#include "arm_dynamics.h"

namespace
{
constexpr int kBlock = 500;  // cycles with the header, then as many without

using Clock = std::chrono::steady_clock;

int64_t ns(Clock::duration duration)
{
  return std::chrono::duration_cast<std::chrono::nanoseconds>(duration).count();
}

void prepare(int core, int priority)
{
  cpu_set_t cores;
  CPU_ZERO(&cores);
  CPU_SET(core, &cores);
  sched_param parameters{};
  parameters.sched_priority = priority;
  if (
    sched_setaffinity(0, sizeof cores, &cores) ||
    (priority && sched_setscheduler(0, SCHED_FIFO, &parameters)) ||
    (priority && mlockall(MCL_CURRENT | MCL_FUTURE)))
  {
    std::perror("header_in_loop");
    std::_Exit(1);
  }
}

// A torque at a state on a motion, as a controller needs it each cycle.
double header(double t)
{
  double q[ARM_JOINTS], dq[ARM_JOINTS], ddq[ARM_JOINTS], tau[ARM_JOINTS], sum = 0.0;
  for (int i = 0; i < ARM_JOINTS; i++) {
    const double w = 1.0 + 0.3 * i;
    q[i] = 0.5 * std::sin(w * t);
    dq[i] = 0.5 * w * std::cos(w * t);
    ddq[i] = -w * w * q[i];
  }
  arm_torque(q, dq, ddq, tau);
  for (double each : tau) sum += each;
  return sum;
}
}  // namespace

int main(int count, char ** arguments)
{
  const std::string folder = arguments[1];
  const std::size_t cycles = std::strtoul(arguments[2], nullptr, 10);
  auto & manager = made(count, arguments);
  prepare(std::atoi(arguments[3]), std::atoi(arguments[4]));
  std::vector<int64_t> measured;
  measured.reserve(3 * cycles);
  const std::chrono::nanoseconds period(1000000000 / manager.get_update_rate());
  const rclcpp::Duration duration(period);
  volatile double sink = 0.0;
  bool begun = false;
  auto next = Clock::now();
  for (std::size_t cycle = 0; measured.size() < 3 * cycles && rclcpp::ok(nullptr); cycle++) {
    std::this_thread::sleep_until(next);
    const auto woken = Clock::now();
    const auto time = now();
    manager.read(time, duration);
    manager.update(time, duration);
    manager.write(time, duration);
    const auto updated = Clock::now();
    const bool called = cycle / kBlock % 2;
    if (called) sink = sink + header(1e-3 * cycle);
    const auto done = Clock::now();
    if (begun) {
      measured.insert(
        measured.end(),
        {ns(woken - next), ns(updated - woken), called ? ns(done - updated) : -1});
    } else if (cycle % kBlock == 0) {
      begun = access((folder + "/begin").c_str(), F_OK) == 0;
    }
    next += period;
  }
  const auto path = folder + "/cycles.part";
  std::FILE * const file = std::fopen(path.c_str(), "wb");
  std::fwrite(measured.data(), sizeof measured[0], measured.size(), file);
  std::fclose(file);
  std::rename(path.c_str(), (folder + "/cycles").c_str());
  run(manager);  // until it is ended
  std::_Exit(0);
}
