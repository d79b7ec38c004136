// Torques as kdl_inverse_dynamics_solver evaluates them, with the kdl_parser and the KDL of ROS:
// kdl_solver URDF ROOT TIP GX GY GZ JOINTS < states    one line of q, dq, ddq per state
// The libraries are there without their headers, so what is called is declared here; objects get
// more room than they need, and the program ends without destroying them.
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <string>

using Room = unsigned char[4096];

namespace KDL
{
struct Vector
{
  double data[3];
  Vector(double x, double y, double z) : data{x, y, z} {}
  Vector(const Vector & other) : data{other.data[0], other.data[1], other.data[2]} {}
};
struct Chain
{
  Chain();
  alignas(16) Room room;
};
struct Tree
{
  explicit Tree(const std::string & root);
  bool getChain(const std::string & root, const std::string & tip, Chain & chain) const;
  alignas(16) Room room;
};
struct JntArray
{
  explicit JntArray(unsigned int size);
  double & operator()(unsigned int row, unsigned int column);
  alignas(16) Room room;
};
struct JntSpaceInertiaMatrix
{
  explicit JntSpaceInertiaMatrix(int size);
  double & operator()(unsigned int row, unsigned int column);
  alignas(16) Room room;
};
struct ChainDynParam
{
  ChainDynParam(const Chain & chain, Vector gravity);
  int JntToCoriolis(const JntArray & q, const JntArray & dq, JntArray & coriolis);
  int JntToMass(const JntArray & q, JntSpaceInertiaMatrix & inertia);
  int JntToGravity(const JntArray & q, JntArray & gravity);
  alignas(16) Room room[16];
};
}  // namespace KDL

namespace kdl_parser
{
bool treeFromString(const std::string & urdf, KDL::Tree & tree);
}

static bool read(KDL::JntArray & values, unsigned int n)
{
  for (unsigned int i = 0; i < n; i++) {
    if (std::scanf("%lf", &values(i, 0)) != 1) {return false;}
  }
  return true;
}

int main(int, char ** arguments)
{
  std::ifstream file(arguments[1]);
  const std::string urdf{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  auto & tree = *new KDL::Tree("root");
  auto & chain = *new KDL::Chain;
  if (!kdl_parser::treeFromString(urdf, tree)) {std::_Exit(1);}
  if (!tree.getChain(arguments[2], arguments[3], chain)) {std::_Exit(2);}
  const KDL::Vector down(
    std::atof(arguments[4]), std::atof(arguments[5]), std::atof(arguments[6]));
  const unsigned int n = std::atoi(arguments[7]);
  auto & solver = *new KDL::ChainDynParam(chain, down);
  auto & inertia = *new KDL::JntSpaceInertiaMatrix(n);
  KDL::JntArray q(n), dq(n), ddq(n), coriolis(n), gravity(n);
  while (read(q, n) && read(dq, n) && read(ddq, n)) {
    if (solver.JntToMass(q, inertia) || solver.JntToCoriolis(q, dq, coriolis) ||
      solver.JntToGravity(q, gravity)) {std::_Exit(3);}
    for (unsigned int i = 0; i < n; i++) {
      double torque = coriolis(i, 0) + gravity(i, 0);
      for (unsigned int j = 0; j < n; j++) {torque += inertia(i, j) * ddq(j, 0);}
      std::printf("%.17g ", torque);
    }
    std::printf("\n");
  }
  std::fflush(stdout);
  std::_Exit(0);
}
