/* The little of BehaviorTree.CPP 4 that the page on exporting uses, so that its recipe compiles
 * where the library is not installed: same names, same types, no behaviour. */
#ifndef BT_FACTORY_STAND_IN_H
#define BT_FACTORY_STAND_IN_H

#include <map>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

namespace BT
{
enum class NodeStatus { IDLE, RUNNING, SUCCESS, FAILURE, SKIPPED };

struct PortInfo {};
using PortsList = std::map<std::string, PortInfo>;

template <typename T>
std::pair<std::string, PortInfo> InputPort(const std::string &name)
{
    return {name, {}};
}

template <typename T>
std::pair<std::string, PortInfo> OutputPort(const std::string &name)
{
    return {name, {}};
}

struct NodeConfig {};

struct RuntimeError : std::runtime_error {
    template <typename... Texts>
    explicit RuntimeError(const Texts &...texts) : std::runtime_error((std::string(texts) + ...))
    {
    }
};

template <typename T>
class Expected
{
public:
    explicit operator bool() const { return value_.has_value(); }
    const T &value() const { return *value_; }
    std::string error() const { return "no value"; }

private:
    std::optional<T> value_;
};

class SyncActionNode
{
public:
    SyncActionNode(const std::string &, const NodeConfig &) {}
    virtual ~SyncActionNode() = default;
    virtual NodeStatus tick() = 0;

protected:
    template <typename T>
    Expected<T> getInput(const std::string &) const
    {
        return {};
    }

    template <typename T>
    void setOutput(const std::string &, const T &)
    {
    }
};

class BehaviorTreeFactory
{
public:
    template <typename Node>
    void registerNodeType(const std::string &)
    {
        (void)Node::providedPorts();
        Node made{std::string(), NodeConfig()};
        (void)made;
    }
};
}  // namespace BT

#define BT_REGISTER_NODES(factory) \
    extern "C" void BT_RegisterNodesFromPlugin(BT::BehaviorTreeFactory &factory); \
    void BT_RegisterNodesFromPlugin(BT::BehaviorTreeFactory &factory)

#endif
