// Points of mesh files.

#include "physics_pool/robot/mesh.hpp"

#include <gmock/gmock.h>

#include <array>
#include <cstdint>
#include <cstring>
#include <numbers>
#include <random>

#include "tests/support/temp_folder.hpp"

namespace jostle::physics_pool {
namespace {

using namespace tests;

using testing::HasSubstr;
using testing::UnorderedElementsAreArray;

using Point = std::array<double, 3>;
using Triangle = std::array<Point, 3>;

// A corner of a cube: the origin and a unit along every axis. All are floats without rounding.
const std::vector<Point> kCorner{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 0.5}};

std::vector<Triangle> tetrahedron() {
  return {{kCorner[0], kCorner[2], kCorner[1]},
          {kCorner[0], kCorner[1], kCorner[3]},
          {kCorner[0], kCorner[3], kCorner[2]},
          {kCorner[1], kCorner[2], kCorner[3]}};
}

std::string binary_stl(const std::vector<Triangle>& triangles, std::string header = "") {
  std::string bytes = header;
  bytes.resize(80, ' ');
  const auto put = [&](const auto& value) {
    char raw[sizeof value];
    std::memcpy(raw, &value, sizeof value);
    bytes.append(raw, sizeof value);
  };
  put(static_cast<std::uint32_t>(triangles.size()));
  for (const Triangle& triangle : triangles) {
    for (int i = 0; i < 3; ++i) put(7.0f);  // the normal is nobody's point
    for (const Point& point : triangle) {
      for (const double x : point) put(static_cast<float>(x));
    }
    put(std::uint16_t{0});
  }
  return bytes;
}

std::string text_stl(const std::vector<Triangle>& triangles) {
  std::ostringstream out;
  out << "solid thing\n";
  for (const Triangle& triangle : triangles) {
    out << "  facet normal 7 7 7\n    outer loop\n";
    for (const Point& p : triangle) out << "      vertex " << p[0] << ' ' << p[1] << ' ' << p[2] << '\n';
    out << "    endloop\n  endfacet\n";
  }
  out << "endsolid thing\n";
  return out.str();
}

class Mesh : public testing::Test {
 protected:
  std::vector<Point> points(const std::string& file, const std::string& content) const {
    const auto vertices_result = mesh_vertices(folder.write(file, content));
    if (!vertices_result) throw std::runtime_error(vertices_result.error().message);
    std::vector<Point> found;
    for (std::size_t i = 0; i < vertices_result->size(); i += 3) {
      found.push_back({(*vertices_result)[i], (*vertices_result)[i + 1], (*vertices_result)[i + 2]});
    }
    return found;
  }
  Error refusal(const std::string& file, const std::string& content) const {
    const auto vertices_result = mesh_vertices(folder.write(file, content));
    return vertices_result ? Error{Code::kInternal, "it was read"} : vertices_result.error();
  }

  TempFolder folder;
};

TEST_F(Mesh, ReadsBinaryStl) {
  EXPECT_THAT(points("a.stl", binary_stl(tetrahedron())), UnorderedElementsAreArray(kCorner));
}

TEST_F(Mesh, ReadsBinaryStlThatBeginsLikeText) {
  EXPECT_THAT(points("a.stl", binary_stl(tetrahedron(), "solid of a program")), UnorderedElementsAreArray(kCorner));
}

TEST_F(Mesh, ReadsTextStl) {
  EXPECT_THAT(points("a.stl", text_stl(tetrahedron())), UnorderedElementsAreArray(kCorner));
}

TEST_F(Mesh, ReadsObj) {
  const std::string text = R"(# a comment with v 9 9 9
mtllib thing.mtl
v 0 0 0
v 1 0 0 0.5 0.5 0.5
vn 7 7 7
vt 7 7
  v 0 1e0 0
v 0 0 5e-1
f 1/1/1 2/1/1 3/1/1
)";
  EXPECT_THAT(points("a.obj", text), UnorderedElementsAreArray(kCorner));
}

TEST_F(Mesh, ReadsLinesThatEndAsOnWindows) {
  EXPECT_THAT(points("a.obj", "v 0 0 0\r\nv 1 0 0\r\nv 0 1 0\r\nv 0 0 0.5\r\n"), UnorderedElementsAreArray(kCorner));
}

TEST_F(Mesh, TakesEndingsInCapitals) {
  EXPECT_THAT(points("A.STL", binary_stl(tetrahedron())), UnorderedElementsAreArray(kCorner));
}

TEST_F(Mesh, HasEveryPointOnce) {
  std::vector<Triangle> twice = tetrahedron();
  const std::vector<Triangle> once = tetrahedron();
  twice.insert(twice.end(), once.begin(), once.end());
  EXPECT_THAT(points("a.stl", binary_stl(twice)), UnorderedElementsAreArray(kCorner));
}

TEST_F(Mesh, IsRefusedWithTooFewPoints) {
  const Error error = refusal("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 1 0\n");
  EXPECT_EQ(error.code, Code::kInvalidArgument);
  EXPECT_THAT(error.message, testing::AllOf(HasSubstr("a.obj"), HasSubstr("got 3 points"), HasSubstr("4 or more")));
}

TEST_F(Mesh, IsRefusedWhenItIsEmpty) {
  for (const char* file : {"a.stl", "a.obj"}) {
    const Error error = refusal(file, "");
    EXPECT_EQ(error.code, Code::kInvalidArgument);
    EXPECT_THAT(error.message, HasSubstr("got 0 points in 0 bytes"));
  }
}

TEST_F(Mesh, IsRefusedWhenItWasCutOff) {
  const std::string whole = binary_stl(tetrahedron());
  for (const std::size_t size : {std::size_t{50}, std::size_t{84}, whole.size() - 1}) {
    const Error error = refusal("a.stl", whole.substr(0, size));
    EXPECT_EQ(error.code, Code::kInvalidArgument);
    EXPECT_THAT(error.message, HasSubstr("got 0 points in " + std::to_string(size) + " bytes"));
  }
}

TEST_F(Mesh, IsRefusedWithPointsThatAreNoNumbers) {
  std::vector<Triangle> triangles = tetrahedron();
  triangles[1][1][2] = std::nan("");
  const std::string lines = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n";
  for (const auto& [file, content] :
       {std::pair("a.stl", binary_stl(triangles)), std::pair("b.obj", lines + "v 0 one 0\n"),
        std::pair("c.obj", lines + "v 0 1\n"), std::pair("d.obj", lines + "v 0 nan 0\n"),
        std::pair("e.stl", std::string("solid\nvertex 0 0 inf\n"))}) {
    const Error error = refusal(file, content);
    EXPECT_EQ(error.code, Code::kInvalidArgument);
    EXPECT_THAT(error.message, testing::AllOf(HasSubstr(file), HasSubstr("damaged vertex"), HasSubstr("finite")));
  }
  EXPECT_THAT(refusal("b.obj", lines + "v 0 one 0\n").message, HasSubstr("number 5"));
}

TEST_F(Mesh, IsRefusedInOtherFormatsWithARemedy) {
  for (const char* file : {"a.dae", "a.ply", "a"}) {
    const Error error = refusal(file, "<COLLADA/>");
    EXPECT_EQ(error.code, Code::kInvalidArgument);
    EXPECT_THAT(error.message, testing::AllOf(HasSubstr(file), HasSubstr("STL or OBJ"), HasSubstr("remedy: convert")));
  }
}

TEST_F(Mesh, CannotBeReadWhereThereIsNoFile) {
  for (const auto& file : {folder.path() / "none.stl", folder.path()}) {
    const auto vertices_result = mesh_vertices(file);
    ASSERT_FALSE(vertices_result);
    EXPECT_NE(vertices_result.error().code, Code::kIo);  // somebody asked for it
    EXPECT_THAT(vertices_result.error().message, HasSubstr(file.string()));
  }
}

// An ellipsoid of many points, none of them on an axis.
std::vector<Point> ellipsoid(int count) {
  std::mt19937 random(11);
  std::normal_distribution<double> normal;
  std::vector<Point> points;
  for (int i = 0; i < count; ++i) {
    const Point d{normal(random), normal(random), normal(random)};
    const double length = std::sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
    points.push_back({0.3 * d[0] / length, 0.02 * d[1] / length + 1, 0.1 * d[2] / length});
  }
  return points;
}

std::string obj(const std::vector<Point>& points) {
  std::ostringstream out;
  out.precision(17);
  for (const Point& p : points) out << "v " << p[0] << ' ' << p[1] << ' ' << p[2] << '\n';
  return out.str();
}

TEST_F(Mesh, KeepsAllOf400Points) {
  const std::vector<Point> all = ellipsoid(400);
  EXPECT_THAT(points("a.obj", obj(all)), UnorderedElementsAreArray(all));
}

TEST_F(Mesh, KeepsTheExtentsOfManyPoints) {
  const std::vector<Point> all = ellipsoid(5000), kept = points("a.obj", obj(all));
  EXPECT_LE(kept.size(), 400u);
  EXPECT_GT(kept.size(), 200u);
  EXPECT_THAT(kept, testing::Each(testing::AnyOfArray(all)));
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto along = [&](const Point& p) { return p[axis]; };
    EXPECT_EQ(along(std::ranges::max(kept, {}, along)), along(std::ranges::max(all, {}, along)));
    EXPECT_EQ(along(std::ranges::min(kept, {}, along)), along(std::ranges::min(all, {}, along)));
  }
}

// No direction is more than about 8 degrees from one of the 400, and there is a point within 2 degrees of each: a
// sphere loses at most 1 - cos(10 degrees) of its radius.
TEST_F(Mesh, KeepsMostOfAHullInEveryDirection) {
  std::vector<Point> all = ellipsoid(5000);
  for (Point& p : all) p = {p[0] / 0.3, (p[1] - 1) / 0.02, p[2] / 0.1};
  const std::vector<Point> kept = points("a.obj", obj(all));
  for (const Point& d : all) {
    const auto along = [&](const Point& p) { return d[0] * p[0] + d[1] * p[1] + d[2] * p[2]; };
    EXPECT_GT(along(std::ranges::max(kept, {}, along)), std::cos(10 * std::numbers::pi / 180));
  }
}

TEST_F(Mesh, KeepsTheCornersOfABoxOfManyPoints) {
  std::vector<Point> all;
  for (int i = 0; i <= 8; ++i) {
    for (int j = 0; j <= 8; ++j) {
      for (int k = 0; k <= 8; ++k) all.push_back({i / 8.0, j / 4.0, k / 2.0});
    }
  }
  const std::vector<Point> kept = points("a.obj", obj(all));
  for (const double x : {0.0, 1.0}) {
    for (const double y : {0.0, 2.0}) {
      for (const double z : {0.0, 4.0}) EXPECT_THAT(kept, testing::Contains(Point{x, y, z}));
    }
  }
}

}  // namespace
}  // namespace jostle::physics_pool
