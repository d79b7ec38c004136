// The program ros2_control_node, made of the library controller_manager: the Jazzy of the PyPI
// wheel has no program. What is called is declared here, since the headers are not there either;
// objects get more room than they need, and the program ends without destroying them.
//
// As the packaged program, it takes the URDF from the topic robot_description and its parameters
// from --params-file. It knows no real-time priority and no simulated time.
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <new>
#include <string>
#include <thread>

struct rcutils_allocator_s
{
  void * functions_and_state[5];
};
extern "C" rcutils_allocator_s rcutils_get_default_allocator();
enum rcl_clock_type_e { RCL_CLOCK_UNINITIALIZED, RCL_ROS_TIME, RCL_SYSTEM_TIME, RCL_STEADY_TIME };

namespace rclcpp
{
class Context;
enum class SignalHandlerOptions { All };
struct InitOptions
{
  explicit InitOptions(rcutils_allocator_s allocator);
  alignas(16) unsigned char room[4096];
};
struct NodeOptions
{
  NodeOptions(NodeOptions const & other);
  alignas(16) unsigned char room[4096];
};
struct ExecutorOptions
{
  ExecutorOptions();
  alignas(16) unsigned char room[4096];
};
class Time
{
public:
  Time(int64_t nanoseconds, rcl_clock_type_e clock);
  virtual ~Time();
  alignas(16) unsigned char room[64];
};
class Duration
{
public:
  explicit Duration(std::chrono::nanoseconds nanoseconds);
  virtual ~Duration();
  alignas(16) unsigned char room[64];
};
class Node : public std::enable_shared_from_this<Node>
{
public:
  virtual ~Node();
};
class Executor
{
public:
  void add_node(std::shared_ptr<Node> node, bool notify);
};
namespace executors
{
class SingleThreadedExecutor : public Executor
{
public:
  explicit SingleThreadedExecutor(ExecutorOptions const & options);
  void spin();
};
}  // namespace executors
void init(int, char const * const *, InitOptions const &, SignalHandlerOptions);
bool ok(std::shared_ptr<Context> context);
}  // namespace rclcpp

namespace controller_manager
{
rclcpp::NodeOptions get_cm_node_options();
class ControllerManager : public rclcpp::Node
{
public:
  ControllerManager(
    std::shared_ptr<rclcpp::Executor> executor, std::string const & name,
    std::string const & ns, rclcpp::NodeOptions const & options);
  unsigned int get_update_rate() const;
  void read(rclcpp::Time const & time, rclcpp::Duration const & period);
  int update(rclcpp::Time const & time, rclcpp::Duration const & period);
  void write(rclcpp::Time const & time, rclcpp::Duration const & period);
};
}  // namespace controller_manager

namespace
{
constexpr std::size_t kRoomOfExecutor = 1 << 16;
constexpr std::size_t kRoomOfManager = 1 << 20;

rclcpp::Time now()
{
  using std::chrono::nanoseconds;
  const auto since_start = std::chrono::steady_clock::now().time_since_epoch();
  return {std::chrono::duration_cast<nanoseconds>(since_start).count(), RCL_STEADY_TIME};
}

std::thread services;

// Makes the manager, and a thread that answers its services.
controller_manager::ControllerManager & made(int count, char ** arguments)
{
  const auto allocator = rcutils_get_default_allocator();
  rclcpp::init(
    count, arguments, *new rclcpp::InitOptions(allocator), rclcpp::SignalHandlerOptions::All);
  auto executor = new (::operator new(kRoomOfExecutor))
    rclcpp::executors::SingleThreadedExecutor(*new rclcpp::ExecutorOptions());
  const std::shared_ptr<rclcpp::Executor> shared(executor, [](rclcpp::Executor *) {});
  auto manager = new (::operator new(kRoomOfManager)) controller_manager::ControllerManager(
    shared, "controller_manager", "", controller_manager::get_cm_node_options());
  executor->add_node({manager, [](rclcpp::Node *) {}}, true);
  services = std::thread([executor] { executor->spin(); });
  return *manager;
}

void run(controller_manager::ControllerManager & manager)
{
  const std::chrono::nanoseconds period(1000000000 / manager.get_update_rate());
  const rclcpp::Duration duration(period);
  for (auto next = std::chrono::steady_clock::now(); rclcpp::ok(nullptr);
    std::this_thread::sleep_until(next))
  {
    const auto time = now();
    manager.read(time, duration);
    manager.update(time, duration);
    manager.write(time, duration);
    next += period;
  }
}
}  // namespace

int main(int count, char ** arguments)
{
  run(made(count, arguments));
  services.join();
  std::_Exit(0);
}
