#pragma once

#include "contact/contact.hpp"
#include "contact/contact_block.hpp"
#include "contact/extended.hpp"
#include "contact/math/dimension.hpp"
#include "contact/math/rotation.hpp"
#include "contact/math/upper.hpp"
#include "contact/math/vec.hpp"
#include "contact/packs.hpp"

#include "atom.h"
#include "bodies.h"
#include "comm.h"
#include "domain.h"
#include "force.h"
#include "neigh_list.h"
#include "neighbor.h"
#include "pair_contact.h"
#include "timer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

namespace jamshape {

/// The loop over contacts, once for all shapes, in 2D and 3D. LAMMPS's list holds pairs of bounding
/// spheres; this class keeps the pairs whose surfaces are closer than a margin, and consults
/// LAMMPS's list again when particles have moved, rotated or been pushed together by that margin.
template <class Model> class PairContactOf : public PairContact {
 public:
  using PairContact::PairContact;

  static std::string name() { return std::string(Model::NAME) + "/harmonic"; }

  void init_list(int id, LAMMPS_NS::NeighList *neigh_list) override
  {
    PairContact::init_list(id, neigh_list);
    margin = MARGIN_OVER_SKIN * neighbor->skin;
  }

  void compute(int eflag, int vflag) override
  {
    ev_init(eflag, vflag);
    if (domain->dimension == 2) {
      compute_in<2>();
    } else {
      compute_in<3>();
    }
  }

  void for_each_bond(const std::function<void(const LocalBond &)> &visit) override
  {
    domain->dimension == 2 ? visit_bonds<2>(visit) : visit_bonds<3>(visit);
  }

  void for_each_curvature(const std::function<void(const LocalCurvature &)> &visit) override
  {
    domain->dimension == 2 ? visit_curvatures<2>(visit) : visit_curvatures<3>(visit);
  }

  /// Includes one for the contact itself.
  int curvature_cost() const override
  {
    return 1 + (domain->dimension == 2 ? PAIR_VARIABLES<2> : PAIR_VARIABLES<3>);
  }

  SubstrateDrag drag(const Vec<3> &semi_axes, int type) const override
  {
    const auto shape = required_shape(semi_axes, type);
    return in_dimension(domain->dimension, [&](auto D) { return Model::template drag<D>(shape); });
  }

  std::optional<int> director(const Vec<3> &semi_axes, int type) const override
  {
    const auto shape = required_shape(semi_axes, type);
    return in_dimension(domain->dimension,
                        [&](auto D) { return Model::template director<D>(shape); });
  }

  bool bonds_are_contacts() const override { return Model::BONDS_ARE_CONTACTS; }

  bool has_current_contacts() const override
  {
    const std::size_t known = domain->dimension == 2 ? in_2d.now.size() : in_3d.now.size();
    return chosen_of >= 0 && chosen_at == neighbor->lastcall && chosen_of == list->inum &&
           known == static_cast<std::size_t>(n_all());
  }

  double memory_usage() override
  {
    return PairContact::memory_usage() + in_2d.memory_usage() + in_3d.memory_usage() +
           static_cast<double>((owner.capacity() + partner.capacity()) * sizeof(int) +
                               last_normal.capacity() * sizeof(float));
  }

 protected:
  std::optional<typename Model::Shape> shape_from(const Vec<3> &semi_axes, int type) const
  {
    const std::optional<typename Model::Form> &form = forms[type];
    return form ? Model::shape_from(semi_axes, *form) : std::nullopt;
  }

  Sides sides = Sides::TWO;

  std::string style_name() const override { return name(); }
  bool is_valid_shape(const Vec<3> &semi_axes, int type) const override
  {
    return shape_from(semi_axes, type).has_value();
  }
  std::string shape_rule() const override { return Model::SHAPE_RULE; }
  bool take_form(int type, const FormNumbers &numbers) override
  {
    const auto found = Model::Form::from(numbers, domain->dimension);
    forms.resize(atom->ntypes + 1);
    if (found || numbers.empty()) forms[type] = found;
    return found.has_value();
  }
  std::string form_name() const override { return Model::FORM; }
  std::string form_rule() const override { return Model::FORM_RULE; }
  bool turns(const Vec<3> &semi_axes, int type) const override
  {
    const auto shape = *shape_from(semi_axes, type);
    return in_dimension(domain->dimension, [&](auto D) { return Model::template turns<D>(shape); });
  }
  Shortcut shortcut(const Vec<3> &semi_axes, int type) const override
  {
    const auto shape = *shape_from(semi_axes, type);
    return in_dimension(domain->dimension,
                        [&](auto D) { return Model::template shortcut<D>(shape); });
  }
  double bounding_radius(const Vec<3> &semi_axes, int type) const override
  {
    const auto shape = *shape_from(semi_axes, type);
    return in_dimension(domain->dimension,
                        [&](auto D) { return Model::template outer_radius<D>(shape); });
  }

 private:
  // A small margin keeps few pairs, a large one keeps them for longer.
  static constexpr double MARGIN_OVER_SKIN = 0.15;

  template <int D> using Body = typename Model::template Body<D>;
  template <int D> using Touch = ContactOf<Model, D>;

  /// Whether the search for a contact is faster from the pair's previous normal.
  template <int D, class = void> struct StartsFromNormal : std::false_type {};
  template <int D>
  struct StartsFromNormal<
      D, std::void_t<decltype(contact_of(
             std::declval<const Body<D> &>(), std::declval<const Body<D> &>(),
             std::declval<const typename Model::Law &>(), std::declval<Vec<D> &>()))>>
      : std::true_type {};

  typename Model::Shape required_shape(const Vec<3> &semi_axes, int type) const
  {
    const auto shape = shape_from(semi_axes, type);
    if (!shape) stop_at_shape(semi_axes, "an atom of type " + std::to_string(type));
    return *shape;
  }

  typename Model::Law law_of(int i, int j) const
  {
    return Model::law({k_e[atom->type[i]][atom->type[j]], power}, sides, !disabled.contact);
  }

  std::vector<std::optional<typename Model::Form>> forms;  // per type

  template <int D> struct Bodies {
    using Pose = typename BodiesOf<Model, D>::Pose;

    BodiesOf<Model, D> now;
    std::vector<Pose> then;  // when pairs were last chosen
    Upper cell_then;

    double memory_usage() const
    {
      return now.memory_usage() + static_cast<double>(then.capacity() * sizeof(Pose));
    }
  };

  Bodies<2> in_2d;
  Bodies<3> in_3d;
  double margin = 0.0, n_listed = 0.0;
  LAMMPS_NS::bigint chosen_at = -1;  // step of the list that pairs were chosen from
  int chosen_of = -1;                // length of that list, which LAMMPS leaves unset before one
  double shapes_read = -1.0;         // when the run began in which shapes were last read
  std::uint64_t shapes = 0;          // their checksum
  bool packs_take_all = false;
  std::vector<int> owner, partner;  // close pairs of an own atom, in order, and another one
  std::vector<float> last_normal;   // D per close pair, if contacts start from it; zeros at first

  template <int D> Bodies<D> &all()
  {
    if constexpr (D == 2) {
      return in_2d;
    } else {
      return in_3d;
    }
  }

  /* ---------------------------------------------------------------------- */

  template <int D> void compute_in()
  {
    update_pairs<D>();
    report_left_out(n_listed, static_cast<double>(partner.size()));
    if (any_turns) {
      evflag ? evaluate<D, true, true>() : evaluate<D, true, false>();
    } else {
      evflag ? evaluate<D, false, true>() : evaluate<D, false, false>();
    }
  }

  template <int D, bool TURNS, bool TALLY> void evaluate()
  {
    if constexpr (PacksOf<Model, D>::EXIST) {
      if (auto *const find = finder<D>()) return evaluate_blocks<D, TURNS, TALLY>(*find);
    }
    evaluate_pairs<D, TURNS, TALLY>();
  }

  /// The function that finds contacts in packs; null if they are evaluated pair by pair.
  template <int D> FindContacts<Model, D> *finder() const
  {
    if constexpr (PacksOf<Model, D>::EXIST) {
      if (packs_take_all) return PacksOf<Model, D>::of(instructions);
    }
    return nullptr;
  }

  /// Evaluates pairs in packs.
  template <int D, bool TURNS, bool TALLY> void evaluate_blocks(FindContacts<Model, D> &find)
  {
    ContactBlock<D> block;
    block.turns = TURNS;
    typename BodiesOf<Model, D>::Block bodies(all<D>().now);
    for (int begin = 0; begin < n_close(); begin += block.MOST) {
      fill<D>(block, bodies, begin, std::min(begin + block.MOST, n_close()));
      add_block<D, TURNS, TALLY>(find, bodies, block, begin);
    }
  }

  int n_close() const { return static_cast<int>(partner.size()); }

  /// Fills a block with close pairs begin to end - 1.
  template <int D, class InBlock>
  void fill(ContactBlock<D> &block, InBlock &bodies, int begin, int end) const
  {
    const int *const type = atom->type;
    block.n = 0;
    bodies.clear();
    for (int k = begin; k < end; ++k) {
      const int i = owner[k], j = partner[k];
      const int at_i = bodies.put_owner(i), at_j = bodies.put(j);
      const Vec<D> r = bodies.data()[at_i].centre - bodies.data()[at_j].centre;
      block.add(at_i, at_j, r, k_e[type[i]][type[j]]);
    }
  }

  /// Adds the contacts of a block, the first of which is of this close pair.
  template <int D, bool TURNS, bool TALLY, class InBlock>
  void add_block(FindContacts<Model, D> &find, InBlock &bodies, ContactBlock<D> &block, int pair)
  {
    read_normals<D>(block, pair);
    const auto i = [&](int k) { return bodies.particle(block.i[k]); };
    const auto j = [&](int k) { return bodies.particle(block.j[k]); };
    find(bodies.data(), law_of(i(0), j(0)), block);
    keep_normals<D>(block, pair);
    block.for_each(block.touching & ~block.alone, [&](int k) {
      add_contact<D, TURNS, TALLY>(
          i(k), j(k),
          {block.energy[k], block.force_of(k), block.torque_i_of(k), block.torque_j_of(k)});
    });
    block.for_each(block.alone, [&](int k) { add_alone<D, TURNS, TALLY>(pair + k, i(k), j(k)); });
  }

  /// Sets the starts of the contacts of a block, if they use normals.
  template <int D> void read_normals(ContactBlock<D> &block, int pair) const
  {
    if (!StartsFromNormal<D>::value || !any_turns) return;
    for (int k = 0; k < block.n; ++k) {
      Vec<D> normal;
      for (int a = 0; a < D; ++a)
        normal[a] = last_normal[static_cast<std::size_t>(D) * (pair + k) + a];
      block.set_start(k, normal);
    }
  }
  template <int D> void keep_normals(const ContactBlock<D> &block, int pair)
  {
    if (!StartsFromNormal<D>::value || !any_turns) return;
    const auto keep = [&](int k) {
      for (int a = 0; a < D; ++a) {
        last_normal[static_cast<std::size_t>(D) * (pair + k) + a] =
            static_cast<float>(block.start[a][k]);
      }
    };
    for (int k = 0; k < block.n; ++k) {
      if (!(block.alone >> k & 1)) keep(k);
    }
  }

  template <int D> struct Load {
    double energy;
    Vec<D> force;
    Torque<D> torque_i, torque_j;
  };

  template <int D, bool TURNS, bool TALLY> void add_contact(int i, int j, const Load<D> &load)
  {
    // Rows of LAMMPS's arrays follow one another: their addresses need not be loaded.
    double *const f = atom->f[0], *const torque = atom->torque[0];
    add_to<D>(f + 3 * std::size_t(i), load.force);
    if constexpr (TURNS) add_torque<D>(torque + 3 * std::size_t(i), load.torque_i);
    if (force->newton_pair || j < atom->nlocal) {
      add_to<D>(f + 3 * std::size_t(j), -load.force);
      if constexpr (TURNS) add_torque<D>(torque + 3 * std::size_t(j), load.torque_j);
    }
    if constexpr (TALLY) tally<D>(i, j, load);
  }

  /// Adds a pair that packs leave out.
  template <int D, bool TURNS, bool TALLY> void add_alone(int pair, int i, int j)
  {
    const BodiesOf<Model, D> &bodies = all<D>().now;
    const Body<D> &body = bodies[i], &other = bodies[j];
    const Touch<D> contact = contact_of_pair<D>(pair, {i, j}, body, other);
    if (contact.status == ContactStatus::APART) return;
    if (contact.status == ContactStatus::CROSSING) stop_at_crossing(i, j);
    if (contact.status == ContactStatus::UNCONVERGED) stop_at_unconverged(i, j);
    add_contact<D, TURNS, TALLY>(
        i, j, {contact.energy, contact.force, contact.torque_i, contact.torque_j});
  }

  template <int D, bool TURNS, bool TALLY> void evaluate_pairs()
  {
    const BodiesOf<Model, D> &bodies = all<D>().now;
    const int nlocal = atom->nlocal, newton = force->newton_pair;
    double **const f = atom->f, **const torque = atom->torque;
    for (int k = 0; k < n_close();) {
      const int i = owner[k];
      const Body<D> body = bodies[i];
      Vec<D> force_i{};
      Torque<D> torque_i{};
      for (; k < n_close() && owner[k] == i; ++k) {
        const int j = partner[k];
        const Body<D> &other = bodies[j];
        const Touch<D> contact = contact_of_pair<D>(k, {i, j}, body, other);
        if (contact.status == ContactStatus::APART) continue;
        if (contact.status == ContactStatus::CROSSING) stop_at_crossing(i, j);
        if (contact.status == ContactStatus::UNCONVERGED) stop_at_unconverged(i, j);
        force_i += contact.force;
        if constexpr (TURNS) torque_i += contact.torque_i;
        if (newton || j < nlocal) {
          add_to<D>(f[j], -contact.force);
          if constexpr (TURNS) add_torque<D>(torque[j], contact.torque_j);
        }
        if constexpr (TALLY)
          tally<D>(i, j, {contact.energy, contact.force, contact.torque_i, contact.torque_j});
      }
      add_to<D>(f[i], force_i);
      if constexpr (TURNS) add_torque<D>(torque[i], torque_i);
    }
  }

  /// Contact of the k-th close pair, of these particles and their bodies.
  template <int D>
  Touch<D> contact_of_pair(int k, const std::array<int, 2> &pair, const Body<D> &i,
                           const Body<D> &j)
  {
    return to_its_digits<Model, D>(contact_begun<D>(k, i, j, law_of(pair[0], pair[1])),
                                   [&] { return pair_in_long<D>(pair[0], pair[1]); });
  }

  /// A starting point affects only the time, so that floats suffice.
  template <int D>
  Touch<D> contact_begun(int k, const Body<D> &i, const Body<D> &j, const typename Model::Law &law)
  {
    if constexpr (StartsFromNormal<D>::value) {
      float *const last = any_turns ? &last_normal[static_cast<std::size_t>(D) * k] : nullptr;
      Vec<D> normal{};
      for (int a = 0; last && a < D; ++a) normal[a] = last[a];
      const Touch<D> contact = contact_of(i, j, law, normal);
      for (int a = 0; last && a < D; ++a) last[a] = static_cast<float>(normal[a]);
      return contact;
    } else {
      return contact_of(i, j, law);
    }
  }

  template <int D> static void add_to(double *to, const Vec<D> &v)
  {
    for (int k = 0; k < D; ++k) to[k] += v[k];
  }

  template <int D> static void add_torque(double *to, const Torque<D> &v)
  {
    if constexpr (D == 2) {
      to[2] += v[0];
    } else {
      add_to<3>(to, v);
    }
  }

  template <int D> void tally(int i, int j, const Load<D> &load)
  {
    const Vec<3> along = in_space<D>(load.force);
    const double *const x = atom->x[i], *const y = atom->x[j];
    const double z = D == 2 ? 0.0 : x[2] - y[2];
    // LAMMPS sums the product of its last and its first vector, xx to yz. A tilt xy of the box
    // moves x by y, so that its stress is r_y f_x. It differs from r_x f_y by torques: hence the
    // swap.
    ev_tally_xyz(i, j, atom->nlocal, force->newton_pair, load.energy, 0.0, x[0] - y[0], x[1] - y[1],
                 z, along[0], along[1], along[2]);
  }

  /* ----------------------------------------------------------------------
     close pairs
  ------------------------------------------------------------------------- */

  template <int D> void update_pairs()
  {
    // LAMMPS rebuilt its list, and with it the order of the atoms, when `ago` is 0.
    if (neighbor->ago == 0 || static_cast<int>(all<D>().now.size()) != n_all()) {
      read_shapes<D>();
      read_poses<D>();
      choose_pairs<D>();
    } else {
      const bool have_shapes_changed = run_began() != shapes_read && read_shapes<D>();
      read_poses<D>();
      if (have_shapes_changed || have_outrun_margin<D>()) choose_pairs<D>();
    }
  }

  int n_all() const { return atom->nlocal + atom->nghost; }

  /// A number that differs between runs, also if 'pre no' skips the set-up.
  double run_began() const { return timer->get_wall(LAMMPS_NS::Timer::TOTAL); }

  /// Placeholder for an atom of other styles in a hybrid one, of which no pair is listed here.
  static typename Model::Shape ball() { return *Model::shape_from({{1.0, 1.0, 1.0}}, {}); }

  /// Returns whether any has changed. The results of the set-up of the run must remain valid.
  template <int D> bool read_shapes()
  {
    BodiesOf<Model, D> &bodies = all<D>().now;
    bodies.begin_shapes(static_cast<std::size_t>(n_all()));
    packs_take_all = !disabled.contact;
    std::optional<typename Model::Shape> of_first;
    const std::vector<int> alike = first_types_of_forms();
    std::uint64_t checksum = 0;
    for (int type = 1; type <= atom->ntypes; ++type) {
      for (const double number : form(type)) checksum = mixed(checksum, number);
    }
    for (int i = 0; i < n_all(); ++i) {
      if (!handles(i)) {
        bodies.set_shape(i, ball(), {1.0, 1.0, 1.0, 1.0});
        continue;
      }
      const Vec<3> semi_axes = particles.semi_axes(i);
      require_shape(i, semi_axes);
      require_same_bound(i, semi_axes);
      const typename Model::Shape shape = *shape_from(semi_axes, atom->type[i]);
      if (!any_turns && Model::template turns<D>(shape)) stop_at_unexpected_turns(i);
      const ShapeNumbers numbers{semi_axes[0], semi_axes[1], semi_axes[2],
                                 static_cast<double>(alike[atom->type[i]])};
      bodies.set_shape(i, shape, numbers);
      for (const double number : numbers) checksum = mixed(checksum, number);
      if constexpr (PacksOf<Model, D>::EXIST) {
        if (!of_first) of_first = shape;
        packs_take_all = packs_take_all && PacksOf<Model, D>::take(shape, *of_first);
      }
    }
    shapes_read = run_began();
    return std::exchange(shapes, checksum) != checksum;
  }

  /// The first type of the same form, for each type.
  std::vector<int> first_types_of_forms() const
  {
    std::vector<int> first_one(atom->ntypes + 1, 0);
    for (int type = 1; type <= atom->ntypes; ++type) {
      int same = 1;
      while (form(same) != form(type)) ++same;
      first_one[type] = same;
    }
    return first_one;
  }

  /// One step of a checksum over numbers in order.
  static std::uint64_t mixed(std::uint64_t sum, double number)
  {
    std::uint64_t bits;
    std::memcpy(&bits, &number, sizeof bits);
    sum = (sum ^ bits) * 0x9e3779b97f4a7c15U;
    return sum ^ sum >> 32;
  }

  template <int D> void read_poses()
  {
    BodiesOf<Model, D> &bodies = all<D>().now;
    bodies.read_centres(atom->x);
    if (any_turns) bodies.read_orientations(particles);
  }

  template <int D> void choose_pairs()
  {
    Bodies<D> &bodies = all<D>();
    require_numbers(atom->nlocal);
    if (D == 2 && any_turns) require_in_plane(atom->nlocal);
    list_close<D>();
    for (std::vector<int> *const each : {&owner, &partner}) {
      if (each->capacity() > each->size() + each->size() / 4) each->shrink_to_fit();
    }
    if (StartsFromNormal<D>::value && any_turns) {
      last_normal.clear();
      resize_closely(last_normal, D * partner.size());
    }
    // A ghost of this rank's own particle moves with it.
    resize_closely(bodies.then, comm->nprocs == 1 ? atom->nlocal : bodies.now.size());
    for (std::size_t i = 0; i < bodies.then.size(); ++i) bodies.then[i] = bodies.now.pose(i);
    bodies.cell_then = cell();
    chosen_at = neighbor->lastcall;
    chosen_of = list->inum;
  }

  /// Lists the pairs whose surfaces are closer than the margin.
  template <int D> void list_close()
  {
    const BodiesOf<Model, D> &bodies = all<D>().now;
    FindContacts<Model, D> *const find = finder<D>();
    const bool in_packs = PacksOf<Model, D>::CHOOSE && find != nullptr && !disabled.pairs;
    owner.clear();
    partner.clear();
    n_listed = 0.0;
    int n_chosen = 0;  // from here on pairs are candidates
    for (int n = 0; n < list->inum; ++n) {
      const int i = list->ilist[n];
      const Body<D> &body = bodies[i];
      const int *const neighbours = list->firstneigh[i];
      for (int k = 0; k < list->numneigh[i]; ++k) {
        const int j = neighbours[k] & NEIGHMASK;
        if (!is_candidate<D>(in_packs, body, bodies[j]) || !has_full_weight(i, neighbours[k]))
          continue;
        owner.push_back(i);
        partner.push_back(j);
        if (in_packs && n_close() - n_chosen == ContactBlock<D>::MOST)
          n_chosen = choose_from<D>(*find, n_chosen);
      }
      n_listed += list->numneigh[i];
    }
    if (in_packs && n_close() > n_chosen) choose_from<D>(*find, n_chosen);
  }

  /// Whether a pair is close, or may be so where packs choose.
  template <int D> bool is_candidate(bool in_packs, const Body<D> &i, const Body<D> &j) const
  {
    if constexpr (PacksOf<Model, D>::CHOOSE) {
      if (in_packs) return Model::template spheres_are_closer<D>(margin, i, j);
    }
    return disabled.pairs || Model::template closer_than<D>(margin, i, j);
  }

  /// Removes the pairs from `begin` on that are not close, at most a block of them. Returns the
  /// number of pairs left.
  template <int D> int choose_from(FindContacts<Model, D> &find, int begin)
  {
    ContactBlock<D> block;
    typename BodiesOf<Model, D>::Block bodies(all<D>().now);
    fill<D>(block, bodies, begin, n_close());
    block.margin = margin;
    find(bodies.data(), Model::law({1.0}, Sides::ONE), block);
    int n_chosen = begin;
    block.for_each(block.touching, [&](int k) {
      owner[n_chosen] = owner[begin + k];
      partner[n_chosen++] = partner[begin + k];
    });
    owner.resize(n_chosen);
    partner.resize(n_chosen);
    return n_chosen;
  }

  /// Whether two particles may have approached by the margin, or a pose is NaN: their own motion on
  /// top of the box's affine one, which reduces a gap g to no less than (1 - strain) g - strain *
  /// (sum of bounding radii).
  template <int D> bool have_outrun_margin()
  {
    const Bodies<D> &bodies = all<D>();
    const Upper now_cell = cell(), since = now_cell * divided(1.0, bodies.cell_then);
    const Vec<3> half = now_cell * Vec<3>{{0.5, 0.5, 0.5}};
    double stretch = 0.0;
    Vec<D> centre;
    for (int k = 0; k < D; ++k) {
      centre[k] = domain->boxlo[k] + half[k];
      stretch = std::max(stretch, std::abs(1.0 - since.diagonal[k]));
    }
    const double strain = stretch + std::hypot(since.xy, since.xz, since.yz);
    const double reach = largest_reach();
    const double left = margin - strain * (reach + margin) - BodiesOf<Model, D>::POSE_ERROR * reach;
    if (!(left > 0.0)) return true;
    for (std::size_t i = 0; i < bodies.then.size(); ++i) {
      const Body<D> &now = bodies.now[i];
      const auto &then = bodies.now.pose_of(i, bodies.then[i]);
      const Vec<D> shift = (now.centre - centre) - since * (then.centre - centre);
      if (!(4.0 * Model::template motion_sq<D>(shift, now, then) < left * left)) return true;
    }
    return false;
  }

  /* ---------------------------------------------------------------------- */

  template <int D> void visit_bonds(const std::function<void(const LocalBond &)> &visit)
  {
    read_poses<D>();
    const BodiesOf<Model, D> &bodies = all<D>().now;
    for (int k = 0; k < n_close();) {
      const int i = owner[k];
      const Body<D> body = bodies[i];
      for (; k < n_close() && owner[k] == i; ++k) {
        const int j = partner[k];
        const Body<D> &other = bodies[j];
        const Touch<D> contact = contact_of_pair<D>(k, {i, j}, body, other);
        if (contact.status != ContactStatus::TOUCHING) continue;
        const Vec<D> r = body.centre - other.centre;
        for (int b = 0; b < contact.n_bonds; ++b) {
          const Bond<D> &bond = contact.bond[b];
          visit({i, j, contact.kind, b, in_space<D>(bond.normal), in_space<D>(bond.force),
                 in_space<D>(bond.arm_i), in_space<D>(bond.arm_i + r), bond.distance, bond.reach,
                 bond.energy, bond.stiffness, bond.on_side_i, bond.on_side_j,
                 Model::on_faces(contact, b, body, other)});
        }
      }
    }
  }

  template <int D> void visit_curvatures(const std::function<void(const LocalCurvature &)> &visit)
  {
    std::vector<double> triangle;
    for (int k = 0; k < n_close(); ++k) {
      const int i = owner[k], j = partner[k];
      const ContactDerivatives<Model, D, double> found =
          derivatives_at<Model, D>(posed_pair<D>(i, j));
      if (found.contact.status != ContactStatus::TOUCHING) continue;
      fill_triangle<D>(found, triangle);
      visit({i, j, triangle});
    }
  }

  template <int D> PosedPair<Model, D, double> posed_pair(int i, int j) const
  {
    Vec<D> r;
    for (int k = 0; k < D; ++k) r[k] = atom->x[i][k] - atom->x[j][k];
    return {*shape_from(particles.semi_axes(i), atom->type[i]),
            *shape_from(particles.semi_axes(j), atom->type[j]),
            r,
            particles.orientation(i),
            particles.orientation(j),
            law_of(i, j)};
  }

  template <int D> PosedPair<Model, D, long double> pair_in_long(int i, int j) const
  {
    auto pair = in_long(posed_pair<D>(i, j));
    for (int k = 0; k < D; ++k) {
      pair.r[k] = static_cast<long double>(atom->x[i][k]) - atom->x[j][k];
    }
    return pair;
  }

  template <int D>
  static void fill_triangle(const ContactDerivatives<Model, D, double> &of,
                            std::vector<double> &triangle)
  {
    triangle.clear();
    for (int row = 0; row < of.N; ++row) {
      for (int col = 0; col <= row; ++col) {
        double sum = of.curvature[row][col];
        for (int b = 0; b < of.contact.n_bonds; ++b) {
          const double stiffness = of.contact.bond[b].own_stiffness;
          sum += stiffness * of.gradient[b][row] * of.gradient[b][col];
        }
        triangle.push_back(sum);
      }
    }
  }

  template <int D> static Vec<3> in_space(const Vec<D> &v)
  {
    return {{v[0], v[1], D == 2 ? 0.0 : v[D - 1]}};
  }
};

/// A constant of this type lists a pair style for LAMMPS.
template <class Style> struct PairStyle {
  PairStyle()
  {
    pair_styles()[Style::name()] = [](LAMMPS_NS::LAMMPS *lmp) -> LAMMPS_NS::Pair * {
      return new Style(lmp);
    };
  }
};

}  // namespace jamshape
