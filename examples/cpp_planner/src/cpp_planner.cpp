// Copyright 2026 dsse_ros maintainers
// SPDX-License-Identifier: Apache-2.0
// A planner in C++, which uses nothing but topics: start `sim_node`, then this.
//
// Each drone has its own columns; it flies to the best cell in them and searches there.

#include <chrono>
#include <cstdint>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include "rclcpp/rclcpp.hpp"
#include "sensor_msgs/msg/image.hpp"
#include "sensor_msgs/msg/point_cloud2.hpp"
#include "sensor_msgs/point_cloud2_iterator.hpp"
#include "std_msgs/msg/string.hpp"

using sensor_msgs::msg::Image;
using sensor_msgs::msg::PointCloud2;
using std_msgs::msg::String;

struct Cell
{
  int col = 0;  // from the west
  int row = 0;  // from the north
};

// Best cell of the columns first to last - 1 of a map (32FC1, row 0 in the north).
Cell best_cell(const Image & map, int first, int last)
{
  Cell best{first, 0};
  float most = -1.0F;
  for (int row = 0; row < static_cast<int>(map.height); ++row) {
    for (int col = first; col < last; ++col) {
      float probability;
      std::memcpy(&probability, &map.data[row * map.step + col * sizeof(float)], sizeof(float));
      if (probability > most) {
        most = probability;
        best = {col, row};
      }
    }
  }
  return best;
}

// Action that brings a drone closer to a cell, or searches there.
std::string action_towards(const Cell & drone, const Cell & goal)
{
  if (goal.col != drone.col) {
    return goal.col > drone.col ? "right" : "left";
  }
  if (goal.row != drone.row) {
    return goal.row > drone.row ? "down" : "up";
  }
  return "search";
}

// Answers every step with one command per drone in the search.
class CppPlanner : public rclcpp::Node
{
public:
  CppPlanner()
  : Node("cpp_planner")
  {
    // A volatile subscription that comes late would miss the first step, and lockstep wait forever.
    const auto latched = rclcpp::QoS(1).transient_local();
    map_subscription_ = create_subscription<Image>(
      "probability", latched, [this](Image::ConstSharedPtr map) {map_ = map;});
    report_subscription_ = create_subscription<PointCloud2>(
      "step_report", latched, [this](PointCloud2::ConstSharedPtr report) {report_ = report;});
    timer_ = create_wall_timer(std::chrono::milliseconds(10), [this] {answer();});
  }

private:
  // Command the drones once per step, when its map and its report are both here.
  void answer()
  {
    if (!map_ || !report_ || report_ == answered_ || map_->header.stamp != report_->header.stamp) {
      return;
    }
    const int drones = static_cast<int>(report_->width);
    while (static_cast<int>(commands_.size()) < drones) {
      const auto topic = "drone" + std::to_string(commands_.size()) + "/cmd_action_name";
      commands_.push_back(create_publisher<String>(topic, 10));
    }
    // A command published before the simulation has subscribed is lost.
    for (const auto & command : commands_) {
      if (command->get_subscription_count() == 0) {
        return;
      }
    }
    answered_ = report_;
    sensor_msgs::PointCloud2ConstIterator<std::int16_t> col(*report_, "col"), row(*report_, "row");
    sensor_msgs::PointCloud2ConstIterator<std::uint8_t> terminated(*report_, "terminated");
    sensor_msgs::PointCloud2ConstIterator<std::uint8_t> truncated(*report_, "truncated");
    const int columns = static_cast<int>(map_->width);
    for (int i = 0; i < drones; ++i, ++col, ++row, ++terminated, ++truncated) {
      if (*terminated || *truncated) {
        continue;
      }
      const auto goal = best_cell(*map_, columns * i / drones, columns * (i + 1) / drones);
      String command;
      command.data = action_towards({*col, *row}, goal);
      commands_[i]->publish(command);
    }
  }

  Image::ConstSharedPtr map_;
  PointCloud2::ConstSharedPtr report_, answered_;
  std::vector<rclcpp::Publisher<String>::SharedPtr> commands_;
  rclcpp::Subscription<Image>::SharedPtr map_subscription_;
  rclcpp::Subscription<PointCloud2>::SharedPtr report_subscription_;
  rclcpp::TimerBase::SharedPtr timer_;
};

int main(int argc, char ** argv)
{
  rclcpp::init(argc, argv);
  rclcpp::spin(std::make_shared<CppPlanner>());
  rclcpp::shutdown();
}
