// CGAL: exact predicates behind a filter, sites inserted along a space-filling curve.

#include "leaves.h"

#include <CGAL/Delaunay_triangulation_2.h>
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Leaf = std::vector<Kernel::Point_2>;

int main(int, char **arguments) {
    const auto add = [](Leaf &leaf, double x, double y) { leaf.emplace_back(x, y); };
    return answer(read_leaves<Leaf>(arguments[1], add), [](const Leaf &leaf) {
        CGAL::Delaunay_triangulation_2<Kernel> mesh;
        mesh.insert(leaf.begin(), leaf.end());
        return static_cast<long>(mesh.number_of_faces());
    });
}
