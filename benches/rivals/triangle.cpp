// Triangle: exact predicates, divide and conquer.

#include "leaves.h"

#define REAL double
#define VOID void
#define ANSI_DECLARATORS
extern "C" {
#include "triangle.h"
}

using Leaf = std::vector<double>;

int main(int, char **arguments) {
    const auto add = [](Leaf &leaf, double x, double y) { leaf.insert(leaf.end(), {x, y}); };
    return answer(read_leaves<Leaf>(arguments[1], add), [](const Leaf &leaf) {
        triangulateio in{}, out{};
        in.pointlist = const_cast<double *>(leaf.data());
        in.numberofpoints = static_cast<int>(leaf.size() / 2);
        // Numbers from zero, quietly, without the sites and marks of the boundary.
        char switches[] = "zQNB";
        triangulate(switches, &in, &out, nullptr);
        const long triangles = out.numberoftriangles;
        trifree(out.trianglelist);
        return triangles;
    });
}
