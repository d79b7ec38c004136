// Whether the urdfdom of ROS reads a file: parse_urdf URDF. Its headers are not there.
#include <fstream>
#include <iterator>
#include <memory>
#include <string>

namespace urdf
{
class ModelInterface;
std::shared_ptr<ModelInterface> parseURDF(const std::string & text);
}

int main(int, char ** files)
{
  std::ifstream file(files[1]);
  std::string text{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  return urdf::parseURDF(text) ? 0 : 1;
}
