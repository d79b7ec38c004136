// The program robot_state_publisher, made of its library: the Jazzy of the tests has no program.
// What is called is declared here, since the headers are not there either; objects get more room
// than they need, and the program ends without destroying them.
#include <cstdlib>
#include <memory>
#include <string>

struct rcutils_allocator_s
{
  void * functions_and_state[5];
};
extern "C" rcutils_allocator_s rcutils_get_default_allocator();

namespace rclcpp
{
class Context;
class Node;
enum class SignalHandlerOptions { All };
struct InitOptions
{
  explicit InitOptions(rcutils_allocator_s allocator);
  alignas(16) unsigned char room[4096];
};
struct NodeOptions
{
  explicit NodeOptions(rcutils_allocator_s allocator);
  alignas(16) unsigned char room[4096];
};
void init(int, char const * const *, InitOptions const &, SignalHandlerOptions);
void spin(std::shared_ptr<Node> node);
}  // namespace rclcpp

namespace robot_state_publisher
{
struct RobotStatePublisher
{
  explicit RobotStatePublisher(rclcpp::NodeOptions const & options);
  alignas(16) unsigned char room[65536];
};
}  // namespace robot_state_publisher

int main(int count, char ** arguments)
{
  const auto allocator = rcutils_get_default_allocator();
  rclcpp::init(
    count, arguments, *new rclcpp::InitOptions(allocator), rclcpp::SignalHandlerOptions::All);
  auto node = new robot_state_publisher::RobotStatePublisher(
    *new rclcpp::NodeOptions(allocator));  // a rclcpp::Node, its first base
  rclcpp::spin({reinterpret_cast<rclcpp::Node *>(node), [](rclcpp::Node *) {}});
  std::_Exit(0);
}
