#pragma once

#include "contact/math/rotation.hpp"
#include "contact/math/vec.hpp"

#include "particle_view.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <map>
#include <type_traits>
#include <vector>

namespace jamshape {

/// The numbers that determine a shape: semi-axes, and the first type of its form.
using ShapeNumbers = std::array<double, 4>;

/// Own and ghost particles as bodies of a model, all stored: for small bodies, whose contacts take
/// so little time that assembling bodies would matter.
template <class Model, int D> class StoredBodies {
 public:
  using Body = typename Model::template Body<D>;
  using Shape = typename Model::Shape;

  std::size_t size() const { return now.size(); }
  const Body &operator[](std::size_t i) const { return now[i]; }

  /// Bodies of a block of contacts, placed for use by packs.
  class Block {
   public:
    explicit Block(const StoredBodies &of) : bodies(of.now.data()) {}
    void clear() {}
    int put(int i) { return i; }
    int put_owner(int i) { return i; }
    int particle(int k) const { return k; }
    const Body *data() const { return bodies; }

   private:
    const Body *bodies;
  };

  void begin_shapes(std::size_t n) { resize_closely(now, n); }
  /// A shape, and the numbers that it was made of.
  void set_shape(std::size_t i, const Shape &shape, const ShapeNumbers &)
  {
    now[i] = Model::template body<D>(shape);
  }

  void read_centres(const double *const *x)
  {
    for (std::size_t i = 0; i < now.size(); ++i) std::copy_n(x[i], D, now[i].centre.c);
  }
  void read_orientations(const ParticleView &view)
  {
    view.for_each_orientation(static_cast<int>(now.size()), [&](int i, const Quaternion &q) {
      Model::template turn_to<D>(now[i], q);
    });
  }

  /// Poses are stored exactly.
  static constexpr double POSE_ERROR = 0.0;
  struct Pose {
    typename Model::template Pose<D> of_model;
  };
  Pose pose(std::size_t i) const { return {Model::template pose<D>(now[i])}; }
  const typename Model::template Pose<D> &pose_of(std::size_t, const Pose &pose) const
  {
    return pose.of_model;
  }

  double memory_usage() const { return static_cast<double>(now.capacity() * sizeof(Body)); }

 private:
  std::vector<Body> now;
};

/// The same for large bodies: each kind of shape (semi-axes and form) is stored once, and bodies
/// are assembled on demand, from LAMMPS's positions and the last orientations read.
template <class Model, int D> class AssembledBodies {
 public:
  using Body = typename Model::template Body<D>;
  using Shape = typename Model::Shape;

  std::size_t size() const { return kind.size(); }

  Body operator[](std::size_t i) const
  {
    Body body = kinds[kind[i]];
    std::copy_n(centres[i], D, body.centre.c);
    if (!orientations.empty()) Model::template turn_to<D>(body, orientations[i]);
    return body;
  }

  class Block {
   public:
    explicit Block(const AssembledBodies &of) : bodies(of) {}
    void clear()
    {
      put_together.clear();
      particles.clear();
      at_owner = -1;
    }
    /// The body of a pair's owner, which may be that of the pair before.
    int put_owner(int i)
    {
      if (at_owner < 0 || particles[at_owner] != i) at_owner = put(i);
      return at_owner;
    }
    int put(int i)
    {
      put_together.push_back(bodies[i]);
      particles.push_back(i);
      return static_cast<int>(particles.size()) - 1;
    }
    int particle(int k) const { return particles[k]; }
    const Body *data() const { return put_together.data(); }

   private:
    const AssembledBodies &bodies;
    std::vector<Body> put_together;
    std::vector<int> particles;
    int at_owner = -1;
  };

  void begin_shapes(std::size_t n)
  {
    resize_closely(kind, n);
    kinds.clear();
    number_of.clear();
    orientations.clear();
  }
  void set_shape(std::size_t i, const Shape &shape, const ShapeNumbers &numbers)
  {
    const auto found = number_of.emplace(numbers, kinds.size());
    if (found.second) kinds.push_back(Model::template body<D>(shape));
    kind[i] = static_cast<int>(found.first->second);
  }

  void read_centres(const double *const *x) { centres = x; }
  void read_orientations(const ParticleView &view)
  {
    resize_closely(orientations, size(), Quaternion{1.0, 0.0, 0.0, 0.0});
    view.for_each_orientation(static_cast<int>(size()),
                              [&](int i, const Quaternion &q) { orientations[i] = q; });
  }

  struct Pose {
    Vec<D> centre;
    float w, i, j, k;
  };
  Pose pose(std::size_t i) const
  {
    Pose pose{{}, 1.0F, 0.0F, 0.0F, 0.0F};
    std::copy_n(centres[i], D, pose.centre.c);
    if (!orientations.empty()) {
      const Quaternion &q = orientations[i];
      pose.w = static_cast<float>(q.w);
      pose.i = static_cast<float>(q.i);
      pose.j = static_cast<float>(q.j);
      pose.k = static_cast<float>(q.k);
    }
    return pose;
  }
  /// Largest error of a point of a body in a stored pose, over the body's bounding radius.
  static constexpr double POSE_ERROR = 1e-6;
  typename Model::template Pose<D> pose_of(std::size_t i, const Pose &pose) const
  {
    Body body = kinds[kind[i]];
    body.centre = pose.centre;
    Model::template turn_to<D>(body, {pose.w, pose.i, pose.j, pose.k});
    return Model::template pose<D>(body);
  }

  double memory_usage() const
  {
    return static_cast<double>(kind.capacity() * sizeof(int) +
                               orientations.capacity() * sizeof(Quaternion) +
                               kinds.size() * (sizeof(Body) + PER_ENTRY));
  }

 private:
  static constexpr std::size_t PER_ENTRY = 96;  // approximate, of the map

  std::vector<int> kind;
  std::vector<Body> kinds;
  std::map<ShapeNumbers, std::size_t> number_of;
  const double *const *centres = nullptr;
  std::vector<Quaternion> orientations;  // empty if no particle can rotate
};

/// Bodies larger than this are assembled on demand.
inline constexpr std::size_t LARGEST_STORED_BODY = 64;

template <class Model, int D>
using BodiesOf =
    std::conditional_t<(sizeof(typename Model::template Body<D>) <= LARGEST_STORED_BODY),
                       StoredBodies<Model, D>, AssembledBodies<Model, D>>;

}  // namespace jamshape
