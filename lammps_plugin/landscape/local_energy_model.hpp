#pragma once

#include "landscape/block_factors.hpp"
#include "landscape/coordinates.hpp"
#include "landscape/kinks.hpp"
#include "landscape/poses.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <Eigen/Core>
#include <map>
#include <memory>
#include <vector>

namespace jamshape {

/// Energy at a point and its derivatives. Two particles, else -1, that cross or whose contact is
/// unconverged invalidate it.
struct LandscapeSums {
  double energy;
  Eigen::VectorXd gradient;  // (n,), positions taken at the strained point
  double strain_gradient, bond_force;
  std::size_t n_bonds;
  std::array<std::int64_t, 2> crossing, unconverged;
  std::vector<double> virial;  // (D, D) sum of r (x) force, with the trace -strain_gradient: both
                               // zero where they were not asked for

  bool crosses() const { return crossing[0] >= 0; }
  bool is_refused() const { return crosses() || unconverged[0] >= 0; }
};

/// Whether to evaluate in extended precision, and the virial, too.
struct EvaluationOptions {
  bool extended, virial;
};

/// Energy of a packing and its derivatives as functions of n coordinates about a base: the
/// interface of integrators and minimisers, which evaluate it thousands of times, for any shape.
/// First of all, `move_to` a base; then each point is one that pairs are renewed for.
class LocalEnergyModel {
 public:
  virtual ~LocalEnergyModel() = default;
  virtual int dimension() const = 0;
  virtual std::size_t n() const = 0;
  virtual std::size_t n_particles() const = 0;
  virtual bool has_base() const = 0;
  virtual const Poses &poses() const = 0;

  /// Sets the base of the coordinates.
  virtual void move_to(const Poses &poses) = 0;
  /// Moves the base to a nearby point.
  virtual void move(const Displacement &at) = 0;
  /// Whether displacements from one base to the next add up: rotations in 3D do not.
  virtual bool adds_up() const = 0;
  /// Stores the base, from which `deform` begins.
  virtual void hold() = 0;
  virtual bool has_held() const = 0;
  /// Moves the base to the image of the stored one: an upper triangular matrix, rows (D, D), maps
  /// positions and cell vectors, and rotation vectors (N, 1 or 3) rotate the particles that can
  /// rotate.
  virtual void deform(const std::vector<long double> &matrix, const double *turns) = 0;
  /// Renews the pairs if any that may touch at a point could be missing, before all else there.
  /// Returns whether it did.
  virtual bool renew_pairs(const Displacement &at) = 0;
  /// Forgets all pairs, so that results depend on the base alone, to the last bit.
  virtual void forget_pairs() = 0;

  /// Whether contacts start from those of the previous point from now on, so that the last bits of
  /// results depend on the points before; for points that follow one another.
  virtual void remember(bool contacts) = 0;

  /// From now on rotations in 3D are about the axes of each body at the base, where its drag is
  /// diagonal, instead of those of space, and factors solve equations, by iteration where they are
  /// incomplete: for stages of a flow.
  virtual void follow_bodies() = 0;

  /// From now on `coupling` and `strain_curvature` are about the strain of these axes (D,), 0 or 1
  /// each, at fixed rotations; at first about that of all axes.
  virtual void strain_along(const std::vector<double> &axes) = 0;

  /// Sets the number of threads of sums over contacts, if there are enough: the last bits depend on
  /// this number, but on nothing else.
  virtual void share(std::size_t threads) = 0;

  virtual LandscapeSums evaluate(const Displacement &at, const EvaluationOptions &with) const = 0;

  /// Whether energies have kinks whose two smooth pieces are known.
  virtual bool has_kinks() const = 0;
  /// The smooth piece on which each pair that may have a kink lies at a point.
  virtual std::map<PairName, int> pieces(const Displacement &at) const = 0;
  virtual std::vector<KinkThere> kinks_at(const Displacement &at, const std::vector<Kink> &kinks,
                                          bool extended) const = 0;
  /// Second derivatives are those of the mixtures on these kinks from now on.
  virtual void hold_kinks(const std::vector<Kink> &kinks) = 0;

  /// At most 1: the fraction of a step (n,) that keeps every particle within its bounds of
  /// displacement and rotation.
  virtual double part_within(const double *step, const StepBounds &bounds) const = 0;
  /// The largest magnitude of a particle's displacement, rotation, force or torque in a vector
  /// (n,).
  virtual double largest_part(const double *vector) const = 0;

  /// Computes second derivatives with respect to the base's coordinates, for the functions below,
  /// whose factors will have this fill-in. In 3D at points without rotations. Crossing
  /// spines contribute nothing.
  virtual void differentiate(const Displacement &at, Fill with) = 0;
  /// (n,) derivative of the gradient with respect to the strain, at that point.
  virtual const Eigen::VectorXd &coupling() const = 0;
  /// Second derivative of the energy with respect to the strain, at that point.
  virtual double strain_curvature() const = 0;
  /// (n,) diagonal of the Hessian at that point.
  virtual Eigen::VectorXd diagonal() const = 0;
  /// Product of that Hessian and a vector (n,).
  virtual Eigen::VectorXd times(const Eigen::Ref<const Eigen::VectorXd> &vector) const = 0;
  /// (n,) for displacements the largest of their diagonal elements, for rotations that of theirs:
  /// nearly round particles rotate far more easily than they move.
  virtual Eigen::VectorXd largest_of_kind() const = 0;
  /// Complete where such factors are always cheap.
  virtual Fill fill() const = 0;
  bool has_complete_factors() const { return fill() == Fill::COMPLETE; }
  /// Factors of that Hessian plus a diagonal (n,); null if a pivot is not positive.
  virtual std::shared_ptr<Factors> factors(const Eigen::VectorXd &diagonal) = 0;

  /// Factors at a point, with the smallest shift, in powers of ten, that makes all pivots positive;
  /// null for non-finite matrices.
  std::shared_ptr<Factors> factorise(const Displacement &at, const Eigen::VectorXd &added)
  {
    differentiate(at, fill());
    const Eigen::VectorXd sum = diagonal() + added;
    if (!sum.allFinite()) return nullptr;
    const double smallest = sum.size() > 0 ? sum.minCoeff() : 1.0;
    const double first =
        std::max(smallest, sum.size() > 0 ? LEAST_SHIFT * sum.cwiseAbs().maxCoeff() : 1.0);
    for (double shift = 0.0; std::isfinite(shift);) {
      const Eigen::VectorXd shifted = added.array() + shift;
      if (auto found = factors(shifted)) return found;
      shift = std::max(10.0 * shift, first);
    }
    return nullptr;
  }
};

}  // namespace jamshape
