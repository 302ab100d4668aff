// What the rivals share: they read leaves, and triangulate all of them once for each line of the input.
//
// The file has 32-bit numbers in the order of bytes of the machine: the number of leaves, then for each leaf the number of its sites, and
// x and y of each. A line of output has the nanoseconds of processor time of the thread, then the number of triangles of each leaf.

#pragma once

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <vector>

inline std::int32_t next_number(std::FILE *file) {
    std::int32_t number;
    if (std::fread(&number, sizeof number, 1, file) != 1) {
        std::fprintf(stderr, "the file of leaves is too short\n");
        std::exit(1);
    }
    return number;
}

// Returns the sites of each leaf as `Leaf`, to which `add(leaf, x, y)` appends a site.
template <class Leaf, class Add> std::vector<Leaf> read_leaves(const char *path, Add add) {
    std::FILE *file = std::fopen(path, "rb");
    if (!file) {
        std::perror(path);
        std::exit(1);
    }
    std::vector<Leaf> leaves(next_number(file));
    for (Leaf &leaf : leaves) {
        for (std::int32_t sites = next_number(file); sites > 0; --sites) {
            const std::int32_t x = next_number(file);
            add(leaf, x, next_number(file));
        }
    }
    std::fclose(file);
    return leaves;
}

inline std::int64_t thread_nanoseconds() {
    timespec time;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
    return std::int64_t(time.tv_sec) * 1000000000 + time.tv_nsec;
}

// Answers each line of the input. `triangulate(leaf)` returns the number of triangles.
template <class Leaf, class Triangulate> int answer(const std::vector<Leaf> &leaves, Triangulate triangulate) {
    std::vector<long> triangles(leaves.size());
    for (int c; (c = std::getchar()) != EOF;) {
        if (c != '\n') {
            continue;
        }
        const std::int64_t start = thread_nanoseconds();
        for (std::size_t i = 0; i < leaves.size(); ++i) {
            triangles[i] = triangulate(leaves[i]);
        }
        std::printf("%lld", static_cast<long long>(thread_nanoseconds() - start));
        for (const long count : triangles) {
            std::printf(" %ld", count);
        }
        std::printf("\n");
        std::fflush(stdout);
    }
    return 0;
}
