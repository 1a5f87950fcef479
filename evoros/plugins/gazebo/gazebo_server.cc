// Simulates robots in worlds with Gazebo's physics library and its plugin for DART.
//
// A server of one client, in lock-step: the variables EVOROS_IN and EVOROS_OUT tell the descriptors
// of requests and answers, so that libraries may print to standard output. gazebo_server.py is the
// client; gazebo_world.py writes the worlds, in which names tell the server all it has to know:
// robots are the models robot0, robot1 ..., their root links are link0, the joints that it drives are
// wheel0 ... and steering0 ..., a collision begins with the name of its group, and walkers are the
// models walker0, walker1 ..., whose joints x and y are moved.
//
// The build defines EVOROS_IGNITION for Fortress, whose namespace and headers are Ignition's.
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <memory>
#include <sstream>
#include <stdexcept>
#include <string>
#include <tuple>
#include <type_traits>
#include <unordered_map>
#include <vector>

#ifdef EVOROS_IGNITION
#include <ignition/common/Console.hh>
#include <ignition/common/Mesh.hh>
#include <ignition/common/SubMesh.hh>
#include <ignition/physics/FindFeatures.hh>
#include <ignition/physics/ForwardStep.hh>
#include <ignition/physics/FrameSemantics.hh>
#include <ignition/physics/FreeGroup.hh>
#include <ignition/physics/GetContacts.hh>
#include <ignition/physics/GetEntities.hh>
#include <ignition/physics/Joint.hh>
#include <ignition/physics/RemoveEntities.hh>
#include <ignition/physics/RequestEngine.hh>
#include <ignition/physics/Shape.hh>
#include <ignition/physics/World.hh>
#include <ignition/physics/config.hh>
#include <ignition/physics/mesh/MeshShape.hh>
#include <ignition/physics/sdf/ConstructModel.hh>
#include <ignition/physics/sdf/ConstructWorld.hh>
#include <ignition/plugin/Loader.hh>
namespace gazebo = ignition;
static const char *const PLUGIN = "ignition::physics::dartsim::Plugin";
#else
#include <gz/common/Console.hh>
#include <gz/common/Mesh.hh>
#include <gz/common/SubMesh.hh>
#include <gz/physics/FindFeatures.hh>
#include <gz/physics/ForwardStep.hh>
#include <gz/physics/FrameSemantics.hh>
#include <gz/physics/FreeGroup.hh>
#include <gz/physics/GetContacts.hh>
#include <gz/physics/GetEntities.hh>
#include <gz/physics/InstallationDirectories.hh>
#include <gz/physics/Joint.hh>
#include <gz/physics/RemoveEntities.hh>
#include <gz/physics/RequestEngine.hh>
#include <gz/physics/Shape.hh>
#include <gz/physics/World.hh>
#include <gz/physics/mesh/MeshShape.hh>
#include <gz/physics/sdf/ConstructModel.hh>
#include <gz/physics/sdf/ConstructWorld.hh>
#include <gz/plugin/Loader.hh>
namespace gazebo = gz;
static const char *const PLUGIN = "gz::physics::dartsim::Plugin";
#endif
#include <sdf/Model.hh>
#include <sdf/Root.hh>
#include <sdf/World.hh>

namespace physics = gazebo::physics;

struct Features
    : physics::FeatureList<
          physics::ForwardStep, physics::GetEntities, physics::GetContactsFromLastStepFeature,
          physics::LinkFrameSemantics, physics::GetBasicJointState,
          physics::GetBasicJointProperties, physics::SetBasicJointState,
          physics::SetJointVelocityCommandFeature, physics::CollisionFilterMaskFeature,
          physics::RemoveModelFromWorld, physics::Gravity,
          physics::mesh::AttachMeshShapeFeature, physics::sdf::ConstructSdfWorld,
          physics::sdf::ConstructSdfModel> {};

using Policy = physics::FeaturePolicy3d;
using Engine = physics::EnginePtr<Policy, Features>;
using World = physics::WorldPtr<Policy, Features>;
using Model = physics::ModelPtr<Policy, Features>;
using Link = physics::LinkPtr<Policy, Features>;
using Joint = physics::JointPtr<Policy, Features>;
using Contact = std::remove_reference_t<decltype(*std::declval<World>())>::ContactPoint;

// Two shapes can touch if their masks share a bit. Rolling shapes of a robot meet the ground alone;
// the bits of 14 robots are different ones.
constexpr std::uint16_t OBSTACLES = 1, CARRIED = 2, ROLLING = 4, GROUND = 0xfffe;
constexpr int ROLLING_BITS = 14;
// If there are walkers, they and the robots' shapes that meet obstacles have this bit alone.
constexpr std::uint16_t WALKERS = 0x8000;
// Owners of shapes that are no robot's; of walkers, that of the first, the others' being lower.
constexpr int WORLD = -1, FLOOR = -2, WALKER = -3;
constexpr double LEAP = 1.0;  // [m], farther than walkers walk in a step

struct Robot
{
  Model model;
  Link base;
  std::vector<Joint> wheels, steering;
  bool touched = false;
};

struct Walker
{
  std::array<Joint, 2> joints;
  double touched = 0.0;  // sum of 2^i over the robots i
};

struct Felt  // a contact of a robot, x and y [m] in its frame
{
  double robot, step, shape, other, x, y;
};

struct Simulation
{
  World world;
  std::vector<Robot> robots;
  std::vector<Link> movable;
  std::vector<Walker> walkers;
  std::unordered_map<std::size_t, int> owners;  // of shapes: a robot's number, WORLD or FLOOR
  std::vector<std::tuple<Joint, std::size_t, double>> coordinates;  // at the start
  double step = 0.0, gain = 1.0;
  std::vector<Felt> felt;
  physics::ForwardStep::Output output;
  physics::ForwardStep::State state;
  physics::ForwardStep::Input input;
};

static bool begins(const std::string &text, const char *start) { return text.rfind(start, 0) == 0; }

static void make_step(Simulation &sim) { sim.world->Step(sim.output, sim.state, sim.input); }

static std::uint16_t choose_mask(const std::string &collision, int robot, bool walkers)
{
  if (walkers && begins(collision, "ground")) return GROUND & ~WALKERS;
  if (walkers && begins(collision, "rolling")) return ROLLING << (robot % (ROLLING_BITS - 1));
  if (walkers && robot >= 0) return choose_mask(collision, robot, false) | WALKERS;
  if (begins(collision, "ground")) return GROUND;
  if (begins(collision, "obstacle")) return OBSTACLES;  // also a rolling part that sticks out
  if (begins(collision, "rolling")) return ROLLING << (robot % ROLLING_BITS);
  return OBSTACLES | CARRIED;
}

// Makes the first step. Debian's plugin has a profiler, which then listens on all addresses of the
// machine. A port that is taken keeps it from starting.
static void keep_profiler_off(const Engine &engine)
{
  const int taken = socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in place{};
  place.sin_family = AF_INET;
  place.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof place;
  auto *address = reinterpret_cast<sockaddr *>(&place);
  if (bind(taken, address, size) || listen(taken, 1) || getsockname(taken, address, &size))
    throw std::runtime_error("no port is free, which the profiler of the library is kept from");
  setenv("RMT_PORT", std::to_string(ntohs(place.sin_port)).c_str(), 1);
  sdf::World empty;
  empty.SetName("empty");
  auto world = engine->ConstructWorld(empty);
  physics::ForwardStep::Output output;
  physics::ForwardStep::State state;
  physics::ForwardStep::Input input;
  world->Step(output, state, input);
  close(taken);
}

static std::string find_plugin()
{
#ifdef EVOROS_IGNITION
  const std::string folder = IGNITION_PHYSICS_ENGINE_INSTALL_DIR;
#else
  const std::string folder = physics::getEngineInstallDir();
#endif
  std::string found;
  std::error_code none;
  for (const auto &entry : std::filesystem::directory_iterator(folder, none))
  {
    const std::string path = entry.path().string();
    if (path.find("dartsim-plugin.so") != std::string::npos && (found.empty() || path < found))
      found = path;
  }
  if (found.empty())
    throw std::runtime_error("no plugin for DART in " + folder + "; install Gazebo's package of it");
  return found;
}

static Engine load_engine(const std::string &library)
{
  static gazebo::plugin::Loader loader;
  if (loader.LoadLib(library).empty()) throw std::runtime_error("cannot load " + library);
  auto plugin = loader.Instantiate(PLUGIN);
  auto engine = physics::RequestEngine3d<Features>::From(plugin);
  if (!engine)
  {
    std::string names;
    for (const auto &name : physics::RequestEngine3d<Features>::MissingFeatureNames(plugin))
      names += " " + name;
    throw std::runtime_error(library + " lacks" + names);
  }
  return engine;
}

// Reads a polyhedron or surface of a model: the link and name of its collision, its pose, its vertices
// and triangles. The library builds no meshes from SDF.
static void attach_mesh(std::istream &text, const Model &model)
{
  std::string link, name;
  std::array<double, 7> at;
  std::size_t vertices, triangles;
  text >> link >> name;
  for (auto &value : at) text >> value;
  text >> vertices >> triangles;
  gazebo::common::SubMesh part;
  part.SetPrimitiveType(gazebo::common::SubMesh::TRIANGLES);
  for (std::size_t i = 0; i < vertices; ++i)
  {
    double x, y, z;
    text >> x >> y >> z;
    part.AddVertex(x, y, z);
    part.AddNormal(0, 0, 1);  // there must be as many as vertices; nothing reads them
  }
  for (std::size_t i = 0; i < 3 * triangles; ++i)
  {
    unsigned int vertex;
    text >> vertex;
    part.AddIndex(vertex);
  }
  if (!text) throw std::runtime_error("a mesh is cut short");
  gazebo::common::Mesh mesh;
  mesh.AddSubMesh(part);
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.translate(Eigen::Vector3d(at[0], at[1], at[2]));
  pose.rotate(Eigen::Quaterniond(at[3], at[4], at[5], at[6]));
  auto owner = model->GetLink(link);
  if (!owner->AttachMeshShape(name, mesh, pose))
    throw std::runtime_error("DART refuses a mesh of " + model->GetName());
  owner->GetShape(owner->GetShapeCount() - 1)->SetCollisionFilterMask(0);
}

template <class Call>
static void for_each_shape(const Model &model, Call call)
{
  for (std::size_t i = 0; i < model->GetLinkCount(); ++i)
    for (std::size_t j = 0; j < model->GetLink(i)->GetShapeCount(); ++j)
      call(model->GetLink(i)->GetShape(j));
}

static void hide(const Model &model)
{
  for_each_shape(model, [](const auto &shape) { shape->SetCollisionFilterMask(0); });
}

static std::vector<Joint> find_joints(const Model &model, const std::string &kind)
{
  std::vector<Joint> joints;
  while (auto joint = model->GetJoint(kind + std::to_string(joints.size()))) joints.push_back(joint);
  return joints;
}

static void reset(Simulation &sim)
{
  // By coordinates: setting poses of models is not exact to the bit.
  for (auto &[joint, index, start] : sim.coordinates)
  {
    joint->SetPosition(index, start);
    joint->SetVelocity(index, 0.0);
    joint->SetAcceleration(index, 0.0);
  }
  for (auto &robot : sim.robots)
    for (auto *joints : {&robot.wheels, &robot.steering})
      for (auto &joint : *joints) joint->SetVelocityCommand(0, 0.0);
  for (auto &walker : sim.walkers)
  {
    walker.touched = 0.0;
    for (auto &joint : walker.joints)
    {
      joint->SetPosition(0, 0.0);
      joint->SetVelocity(0, 0.0);
      joint->SetVelocityCommand(0, 0.0);
    }
  }
}

static void read_model(Simulation &sim, const Model &model, bool fixed)
{
  if (begins(model->GetName(), "walker"))
  {
    const int owner = WALKER - static_cast<int>(sim.walkers.size());
    for_each_shape(model, [&](const auto &shape) {
      sim.owners[shape->EntityID()] = owner;
      shape->SetCollisionFilterMask(WALKERS);
    });
    sim.walkers.push_back({{model->GetJoint("x"), model->GetJoint("y")}});
    return;
  }
  const bool driven = begins(model->GetName(), "robot");
  const int owner = driven ? static_cast<int>(sim.robots.size()) : WORLD;
  for_each_shape(model, [&](const auto &shape) {
    const std::string name = shape->GetName();
    sim.owners[shape->EntityID()] =
        begins(name, "ground") || begins(name, "rolling") ? FLOOR : owner;
    shape->SetCollisionFilterMask(choose_mask(name, owner, !sim.walkers.empty()));
  });
  if (driven)
  {
    Robot robot{model, model->GetLink("link0"), find_joints(model, "wheel"),
                find_joints(model, "steering")};
    sim.robots.push_back(robot);
  }
  else if (!fixed)
    sim.movable.push_back(model->GetLink("link0"));
  for (std::size_t i = 0; i < model->GetJointCount(); ++i)
    for (std::size_t d = 0; d < model->GetJoint(i)->GetDegreesOfFreedom(); ++d)
      sim.coordinates.emplace_back(model->GetJoint(i), d, model->GetJoint(i)->GetPosition(d));
}

// Reads: step [s], gravity [m/s2], share of the steering's error made up in a step, number of meshes,
// the meshes, and the world as SDF.
static std::unique_ptr<Simulation> open(Engine &engine, const std::string &content)
{
  std::istringstream text(content);
  auto sim = std::make_unique<Simulation>();
  double gravity;
  std::size_t meshes;
  text >> sim->step >> gravity >> sim->gain >> meshes;
  sdf::Root root;
  const auto errors = root.LoadSdfString(content.substr(content.find("<sdf")));
  if (!errors.empty()) throw std::runtime_error(errors[0].Message());
  const sdf::World &description = *root.WorldByIndex(0);
  sdf::World empty;
  empty.SetName(description.Name());
  empty.SetGravity({0, 0, 0});
  sim->world = engine->ConstructWorld(empty);
  sim->input.Get<std::chrono::steady_clock::duration>() =
      std::chrono::duration_cast<std::chrono::steady_clock::duration>(
          std::chrono::duration<double>(sim->step));
  make_step(*sim);
  // A step after each model: DART adds the shapes of several new models in an order of addresses, on
  // which the order of contacts and the last bits of their forces would depend.
  std::vector<Model> models;
  for (std::size_t i = 0; i < description.ModelCount(); ++i)
  {
    models.push_back(sim->world->ConstructModel(*description.ModelByIndex(i)));
    if (!models.back())
      throw std::runtime_error("DART refuses the model " + description.ModelByIndex(i)->Name());
    hide(models.back());
    make_step(*sim);
  }
  std::string last, owner;
  for (std::size_t i = 0; i < meshes; ++i)
  {
    text >> owner;
    if (owner != last) make_step(*sim);
    attach_mesh(text, sim->world->GetModel(owner));
    last = owner;
  }
  make_step(*sim);
  for (std::size_t i = 0; i < models.size(); ++i)
    read_model(*sim, models[i], description.ModelByIndex(i)->Static());
  sim->world->SetGravity(Eigen::Vector3d(0.0, 0.0, -gravity));
  reset(*sim);
  return sim;
}

static void note_contacts(Simulation &sim, int step, bool feeling)
{
  for (const auto &contact : sim.world->GetContactsFromLastStep())
  {
    const auto &point = contact.Get<Contact>();
    const std::array<std::size_t, 2> shapes{point.collision1->EntityID(),
                                            point.collision2->EntityID()};
    const std::array<int, 2> owners{sim.owners.at(shapes[0]), sim.owners.at(shapes[1])};
    if (owners[0] == FLOOR || owners[1] == FLOOR) continue;
    for (int side = 0; side < 2; ++side)
    {
      if (owners[side] < 0) continue;
      Robot &robot = sim.robots[owners[side]];
      robot.touched = true;
      if (owners[1 - side] <= WALKER)
      {
        double &touched = sim.walkers[WALKER - owners[1 - side]].touched;
        touched = double(std::uint32_t(touched) | 1u << owners[side]);
      }
      if (!feeling) continue;
      const Eigen::Vector3d at =
          robot.base->FrameDataRelativeToWorld().pose.inverse() * Eigen::Vector3d(point.point);
      sim.felt.push_back({double(owners[side]), double(step), double(shapes[side]),
                          double(shapes[1 - side]), at.x(), at.y()});
    }
  }
}

// Lets walkers be at places [m] after the next step: velocities of joints that nothing holds up move
// them, so that they push what they touch.
static void lead(Simulation &sim, const double *places)
{
  for (auto &walker : sim.walkers)
    for (auto &joint : walker.joints)
    {
      const double way = *places++ - joint->GetPosition(0);
      const bool leaps = std::abs(way) > LEAP;
      if (leaps) joint->SetPosition(0, joint->GetPosition(0) + way);
      joint->SetVelocityCommand(0, leaps ? 0.0 : way / sim.step);
    }
}

// Reads for each robot the rates of its wheels [rad/s] and the angles of its steering [rad], and then
// the places of walkers after each step [m].
static void advance(Simulation &sim, const double *commands, int steps, bool feeling)
{
  const double *places = commands;
  for (auto &robot : sim.robots) places += robot.wheels.size() + robot.steering.size();
  for (int i = 0; i < steps; ++i, places += 2 * sim.walkers.size())
  {
    lead(sim, places);
    const double *command = commands;
    for (auto &robot : sim.robots)
    {
      for (auto &wheel : robot.wheels) wheel->SetVelocityCommand(0, *command++);
      for (auto &joint : robot.steering)
        joint->SetVelocityCommand(0, (*command++ - joint->GetPosition(0)) * sim.gain / sim.step);
    }
    make_step(sim);
    note_contacts(sim, i, feeling);
  }
}

static void add_pose(std::vector<double> &answer, const Eigen::Isometry3d &pose)
{
  const Eigen::Vector3d p = pose.translation();
  const Eigen::Quaterniond q(pose.linear());
  answer.insert(answer.end(), {p.x(), p.y(), p.z(), q.w(), q.x(), q.y(), q.z()});
}

// Returns for each robot its pose, velocities, touch and joints' angles; the poses of movable bodies;
// the robots that each walker has touched since the last answer; and the contacts that were felt.
static std::vector<double> describe(Simulation &sim)
{
  std::vector<double> answer;
  for (auto &robot : sim.robots)
  {
    const auto motion = robot.base->FrameDataRelativeToWorld();
    add_pose(answer, motion.pose);
    for (const auto &v : {motion.linearVelocity, motion.angularVelocity})
      answer.insert(answer.end(), {v.x(), v.y(), v.z()});
    answer.push_back(robot.touched ? 1.0 : 0.0);
    robot.touched = false;
    for (auto *joints : {&robot.wheels, &robot.steering})
      for (auto &joint : *joints) answer.push_back(joint->GetPosition(0));
  }
  for (auto &link : sim.movable) add_pose(answer, link->FrameDataRelativeToWorld().pose);
  for (auto &walker : sim.walkers)
  {
    answer.push_back(walker.touched);
    walker.touched = 0.0;
  }
  for (const auto &f : sim.felt)
    answer.insert(answer.end(), {f.robot, f.step, f.shape, f.other, f.x, f.y});
  sim.felt.clear();
  return answer;
}

// For tests: adds a velocity [m/s] to the first movable body, which must not have turned; returns the
// velocities of all.
static std::vector<double> probe(Simulation &sim, const double *added)
{
  std::vector<double> answer;
  for (std::size_t i = 0; i < sim.movable.size(); ++i)
  {
    auto joint = sim.movable[i]->GetModel()->GetJoint(0);
    for (int axis = 0; axis < 3; ++axis)
    {
      const double velocity = joint->GetVelocity(3 + axis) + (i == 0 ? added[axis] : 0.0);
      joint->SetVelocity(3 + axis, velocity);
      answer.push_back(velocity);
    }
  }
  return answer;
}

static bool transfer(int file, void *place, std::size_t size, bool writing)
{
  for (auto *at = static_cast<char *>(place); size > 0;)
  {
    const ssize_t count = writing ? write(file, at, size) : read(file, at, size);
    if (count <= 0) return false;
    at += count;
    size -= count;
  }
  return true;
}

enum Operation : std::int32_t { START, OPEN, RESET, ADVANCE, FORGET, PROBE };

struct Request
{
  std::int32_t operation, number, steps, feeling;
  std::int64_t size;
};

class Server
{
 public:
  explicit Server(const std::string &library) : engine(load_engine(library))
  {
    keep_profiler_off(engine);
  }

  std::vector<double> answer(const Request &request, const std::string &body)
  {
    if (request.operation == START) return {};
    if (request.operation == OPEN) simulations[request.number] = open(engine, body);
    if (request.operation == FORGET)
    {
      forget(request.number);
      return {};
    }
    Simulation &sim = *simulations.at(request.number);
    if (request.operation == PROBE) return probe(sim, reinterpret_cast<const double *>(body.data()));
    if (request.operation == RESET) reset(sim);
    if (request.operation == ADVANCE)
      advance(sim, reinterpret_cast<const double *>(body.data()), request.steps, request.feeling);
    return describe(sim);
  }

 private:
  void forget(int number)
  {
    auto &sim = *simulations.at(number);
    while (sim.world->GetModelCount() > 0) sim.world->RemoveModel(0);
    simulations.erase(number);
  }

  Engine engine;
  std::map<int, std::unique_ptr<Simulation>> simulations;
};

int main()
{
  const int in = std::stoi(getenv("EVOROS_IN")), out = std::stoi(getenv("EVOROS_OUT"));
  gazebo::common::Console::SetVerbosity(0);
  std::unique_ptr<Server> server;
  Request request;
  std::string body;
  while (transfer(in, &request, sizeof request, false))
  {
    body.resize(request.size);
    if (!transfer(in, body.data(), body.size(), false)) return 1;
    std::string answer;
    std::int64_t head[2] = {0, 0};
    try
    {
      if (!server) server = std::make_unique<Server>(find_plugin());
      const auto values = server->answer(request, body);
      answer.assign(reinterpret_cast<const char *>(values.data()), values.size() * sizeof(double));
    }
    catch (const std::exception &error)
    {
      head[0] = 1;
      answer = error.what();
    }
    gazebo::common::Console::SetVerbosity(1);
    head[1] = answer.size();
    answer.insert(0, reinterpret_cast<const char *>(head), sizeof head);
    if (!transfer(out, answer.data(), answer.size(), true)) return 1;
  }
}
