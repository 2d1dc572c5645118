#pragma once

#include "contact/math/vec.hpp"

#include <cstddef>
#include <vector>

namespace jamshape {

/// One contact of the network: two particles (indices), the normal into i, and whether the contact
/// lies on a face of i, of j. A side-to-side contact of rods is one edge; if the bonds of a contact
/// are contacts of their own (Model::BONDS_ARE_CONTACTS), each is an edge.
struct ContactEdge {
  std::size_t i, j;
  Vec<3> normal;
  bool flat_i, flat_j;
};

/// Rattlers: particles with at most D contacts, unless two of these lie on faces of it with
/// opposite normals, so that neither a translation nor a rotation separates them; removed with
/// their contacts until none is left. In 2D, where the straight sides of rods are faces, it is the
/// rule of Marschall & Teitel 2018, Sec. III C. One contact on a face constrains D motions, but
/// does not prevent lifting off.
class RattlerSearch {
 public:
  RattlerSearch(std::size_t n_particles, const std::vector<ContactEdge> &contacts, int space) :
      edges(contacts), dimension(space), edges_of(n_particles), removed(n_particles, 0)
  {
    for (std::size_t e = 0; e < edges.size(); ++e) {
      edges_of[edges[e].i].push_back(e);
      if (edges[e].j != edges[e].i) edges_of[edges[e].j].push_back(e);
    }
  }

  /// One flag a particle, 1 for rattlers.
  std::vector<char> find()
  {
    std::vector<std::size_t> to_visit(removed.size());
    for (std::size_t n = 0; n < to_visit.size(); ++n) to_visit[n] = n;
    while (!to_visit.empty()) {
      const std::size_t n = to_visit.back();
      to_visit.pop_back();
      if (removed[n] || !is_loose(n)) continue;
      removed[n] = 1;
      for (const std::size_t e : edges_of[n]) {
        to_visit.push_back(edges[e].i == n ? edges[e].j : edges[e].i);
      }
    }
    return removed;
  }

 private:
  const std::vector<ContactEdge> &edges;
  int dimension;
  std::vector<std::vector<std::size_t>> edges_of;
  std::vector<char> removed;

  /// A particle's side of a contact: normal into the particle, and whether it is on a face.
  struct Support {
    Vec<3> normal;
    bool flat;
  };

  bool is_loose(std::size_t n) const
  {
    std::vector<Support> supports;
    for (const std::size_t e : edges_of[n]) {
      const ContactEdge &edge = edges[e];
      if (edge.i == edge.j) {  // touching its own periodic image constrains it from both sides
        supports.push_back({edge.normal, edge.flat_i});
        supports.push_back({-edge.normal, edge.flat_j});
      } else if (edge.i == n && !removed[edge.j]) {
        supports.push_back({edge.normal, edge.flat_i});
      } else if (edge.j == n && !removed[edge.i]) {
        supports.push_back({-edge.normal, edge.flat_j});
      }
    }
    return supports.size() <= static_cast<std::size_t>(dimension) && !is_between_faces(supports);
  }

  static bool is_between_faces(const std::vector<Support> &supports)
  {
    for (const Support &one : supports) {
      for (const Support &other : supports) {
        if (one.flat && other.flat && dot(one.normal, other.normal) < 0.0) return true;
      }
    }
    return false;
  }
};

}  // namespace jamshape
