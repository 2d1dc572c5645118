#pragma once

#include "contact/contact.hpp"
#include "contact/math/rotation.hpp"
#include "contact/math/vec.hpp"

#include <cmath>
#include <optional>

namespace jamshape {

/// Shape and pose of a particle given by its long axis, as the pair loops read it.
template <class Shape, int D, class S = double> struct BodyAlongX {
  Vec<D, S> centre;
  Vec<D, S> axis;
  Plain<S> half_length;
  Plain<S> radius;
};

/// Common base of models whose shape is a half length A >= 0 along the body's x and a radius R;
/// LAMMPS stores the semi-axes (A + R, R, R). A = 0 is a disc (a sphere).
template <class ShapeAlongX> struct AlongX {
  using Shape = ShapeAlongX;
  template <int D, class S = double> using Body = BodyAlongX<Shape, D, S>;
  template <int D> using Start = NoStart;

  using Form = NoForm;
  static constexpr const char *FORM = "";
  static constexpr const char *FORM_RULE = "none";

  /// Returns nothing if the semi-axes do not describe this shape.
  static std::optional<Shape> shape_from(const Vec<3> &semi_axes, const Form &)
  {
    const bool is_one = semi_axes[1] == semi_axes[2] && semi_axes[0] >= semi_axes[1] &&
                        semi_axes[1] > 0.0 && std::isfinite(semi_axes[0]);
    if (!is_one) return std::nullopt;
    return Shape{semi_axes[0] - semi_axes[1], semi_axes[1]};
  }

  /// The overlap of two particles that no contact can rotate is 1 - (r/d)^OVERLAP_POWER.
  static constexpr int OVERLAP_POWER = 1;

  /// Particles that no contact can rotate need no orientation.
  template <int D> static bool turns(const Shape &shape) { return shape.half_length > 0.0; }

  /// Radius of the bounding sphere, and the smallest length of a particle.
  template <int D> static double outer_radius(const Shape &shape)
  {
    return shape.half_length + shape.radius;
  }
  template <int D> static double inner_radius(const Shape &shape) { return shape.radius; }

  /// The length that one radian stands for, 0 if no contact can rotate the particle; and an upper
  /// bound of how far one radian moves its surface towards others.
  template <int D> static double rotation_length(const Shape &shape) { return shape.half_length; }
  template <int D> static double turning_radius(const Shape &shape) { return shape.half_length; }

  /// The body axis (0, 1, 2) of rotational symmetry, and the one that gives a particle's direction;
  /// nothing for particles without one.
  static std::optional<int> symmetry_axis(const Shape &shape) { return director<3>(shape); }
  template <int D> static std::optional<int> director(const Shape &shape)
  {
    return shape.half_length > 0.0 ? std::optional<int>(0) : std::nullopt;
  }

  template <int D, class S = double> static Body<D, S> body(const Shape &shape)
  {
    Vec<D, S> along_x{};
    along_x[0] = 1.0;
    return {{}, along_x, shape.half_length, shape.radius};
  }

  template <int D, class S> static void turn_to(Body<D, S> &body, const QuaternionOf<S> &q)
  {
    body.axis = long_axis<D, S>(q);
  }

  /// Pose of a particle when the pairs were last chosen.
  template <int D> struct Pose {
    Vec<D> centre, axis;
  };
  template <int D> static Pose<D> pose(const Body<D> &body) { return {body.centre, body.axis}; }

  /// The larger of the squared displacements |dx +- A du| of the ends of the axis; no point between
  /// them moved farther.
  template <int D>
  static double motion_sq(const Vec<D> &shift, const Body<D> &now, const Pose<D> &then)
  {
    const Vec<D> turned = now.half_length * (now.axis - then.axis);
    return norm_sq(shift) + norm_sq(turned) + 2.0 * std::abs(dot(shift, turned));
  }

  /// Whether the gap between two bounding spheres is smaller than a margin.
  template <int D> static bool spheres_are_closer(double margin, const Body<D> &i, const Body<D> &j)
  {
    const double bounding = i.radius + j.radius + margin + i.half_length + j.half_length;
    return norm_sq(i.centre - j.centre) < bounding * bounding;
  }
};

}  // namespace jamshape
