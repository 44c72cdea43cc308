// scratch
#include <cstdio>
#include <cstdlib>
#include "materials/evaluation.h"
#include "materials/random_walk.h"
#include "materials/reference_stacks.h"
using namespace nacre::materials;
int main(int c, char** v) {
    const int paths = c > 1 ? atoi(v[1]) : 16384; const int n = c > 2 ? atoi(v[2]) : 48; bool verbose = c > 3;
    std::vector<Tree> stacks = reference_stacks();
    for (int i = 0; i < n; ++i) stacks.push_back(random_stack(i));
    double total = 0;
    for (auto& t : stacks) {
        auto flat = flatten(t);
        if (!flat) { std::puts(flat.error().message().c_str()); continue; }
        double sum = 0, worst = 0, at = 0; double wide = 0;
        RandomWalk walk(*flat), walk2(*flat, {.exact_fresnel = false});
        for (double mu : {1.0, 0.8, 0.6, 0.4, 0.2, 0.1}) {
            glm::dvec3 view(std::sqrt(1 - mu * mu), 0, mu);
            auto a = directional_albedo(shade(*flat, view));
            auto b = walk.albedo(view, paths);
            auto d = glm::abs(a - b.reflected);
            sum += (d.x + d.y + d.z) / 18;
            double m = std::max({d.x, d.y, d.z});
            if (m > worst) { worst = m; at = mu; }
            if (verbose) std::printf("   %.1f closures %.4f %.4f %.4f walk %.4f %.4f %.4f +- %.4f\n", mu, a.x, a.y, a.z, b.reflected.x, b.reflected.y, b.reflected.z, b.uncertainty.x);
        }
        total += sum;
        std::printf("%-50s mean %.4f worst %.4f at %.1f\n", t.name.c_str(), sum, worst, at); std::fflush(stdout);
    }
    std::printf("mean of all %.4f\n", total / stacks.size());
}
