// PBBS: points inserted in parallel, in batches; predicates in double precision, inexact. Compiled with its delaunay.C.

#include "leaves.h"

#include "parlay/primitives.h"

#include "common/geometry.h"
#include "delaunay.h"

#include <chrono>

// Reads points as leaves.h does, and triangulates all of them together once for each line of the input. A line of output has the
// nanoseconds that it took, those of processor time, which include those of threads that look for work, and the number of triangles, which
// has those of a bounding polygon.
int main(int, char **arguments) {
    const auto add = [](std::vector<double> &leaf, double x, double y) { leaf.insert(leaf.end(), {x, y}); };
    parlay::sequence<point> points;
    for (const std::vector<double> &leaf : read_leaves<std::vector<double>>(arguments[1], add)) {
        for (std::size_t i = 0; i < leaf.size(); i += 2) {
            points.push_back(point(leaf[i], leaf[i + 1]));
        }
    }
    for (int c; (c = std::getchar()) != EOF;) {
        const auto processor_time = [] {
            timespec time;
            clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
            return std::int64_t(time.tv_sec) * 1000000000 + time.tv_nsec;
        };
        const std::int64_t cpu = processor_time();
        const auto start = std::chrono::steady_clock::now();
        const triangles<point> made = delaunay(points);
        const auto taken = std::chrono::steady_clock::now() - start;
        std::printf("%lld %lld %zu\n", static_cast<long long>(std::chrono::nanoseconds(taken).count()),
                    static_cast<long long>(processor_time() - cpu), made.T.size());
        std::fflush(stdout);
    }
    return 0;
}
