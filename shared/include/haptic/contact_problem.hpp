// Contact problem: the forces between an elastic tool and the surfaces that hold it back, as one small system.
//
// A row is a direction in which a proxy can be pushed: the normal of one of its planes, or one of two tangents if it
// has friction. With W_rs the displacement of row r per newton on row s (tool and surface together, the hand held
// still), and b_r what row r lacks if nothing pushes, the forces l solve
//
//     min 1/2 l^T W l - b^T l    subject to    l_n >= 0,    |l_t| <= mu (sum of the proxy's l_n)
//
// Normal row: b is the depth of the proxy's free position behind the plane, negative in front of it. Tangential row: b
// is the distance along the tangent to the point at which the proxy sticks. V = l^T b - 1/2 l^T W l is the energy of
// all springs; without friction the wrench is its negative gradient. W is in m/N; for a relative k W, l is per k, in m.
//
// Normal forces: exact to rounding by the dual active-set method of Goldfarb and Idnani in contact space, on a Cholesky
// factor that is updated by rows. Each iterate is the exact solution for some of the rows, so that stopping early gives
// less energy, never more. Where the active rows leave a row no compliance but rounding, it gets two millionths of W_rr
// for itself: the energy then grows with each step, so that no set of active rows comes back.
// Friction: from there, Gauss-Seidel over all rows in order, with each proxy's two tangential forces at their exact
// minimum over its cone (the normal forces do not feel the cone: Coulomb's law), and Anderson acceleration of the
// sweeps. A solution has l^T W l <= l^T b: no tangential force acts against what its row lacks. Forces that the sweeps
// leave without this are scaled until they have it, and then V >= 0 and the springs' energy l^T W l / 2 is at most that
// of springs which satisfy every row, b^T W^-1 b / 2: an unfinished solution is weak, but it throws nothing away.
// @source D. Goldfarb, A. Idnani, "A numerically stable dual method for solving strictly convex quadratic programs",
// 1983; contact space: C. Duriez et al., "Realistic haptic rendering of interacting deformable objects", 2006.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "haptic/anderson_acceleration.hpp"
#include "haptic/cholesky_factor.hpp"
#include "haptic/frames.hpp"
#include "haptic/realtime.hpp"
#include "haptic/types.hpp"

namespace haptic {

struct ContactKernels;

/// Rows of the largest problem: three planes and two tangents of each proxy.
inline constexpr std::size_t kMaxContactRows = kMaxProxies * (kMaxPlanes + 2);

/// Part of each row's own compliance that belongs to the surface: the coupling between different rows is that of the
/// tool times 1 - kSurfaceShare. It keeps the forces bounded where surfaces leave no room, and leaves a single row as
/// it is.
inline constexpr double kSurfaceShare = 1e-3;

/// Symmetric matrix W, m/N, or k W. The memory for kMaxContactRows is allocated by the constructor.
class ComplianceMatrix {
  public:
    ComplianceMatrix() : elements_(kMaxContactRows * kMaxContactRows, 0.0), diagonal_(kMaxContactRows, 0.0) {}

    /// Sets the number of rows, at most kMaxContactRows. The elements are unspecified afterwards.
    void resize(std::size_t rows) HAPTIC_RT { rows_ = rows; }
    [[nodiscard]] std::size_t rows() const HAPTIC_RT { return rows_; }

    /// Sets elements (r, s) and (s, r).
    void set(std::size_t r, std::size_t s, double compliance) HAPTIC_RT {
        elements_[r * kMaxContactRows + s] = elements_[s * kMaxContactRows + r] = compliance;
        if (r == s) {
            diagonal_[r] = compliance;
        }
    }
    /// Sets elements (r, 0) to (r, r); mirror() then sets those above the diagonal, of all rows.
    void set_lower_row(std::size_t r, const float* compliance) HAPTIC_RT {
        std::copy_n(compliance, r + 1, &elements_[r * kMaxContactRows]);
        diagonal_[r] = compliance[r];
    }
    void mirror() HAPTIC_RT;
    [[nodiscard]] double operator()(std::size_t r, std::size_t s) const HAPTIC_RT {
        return elements_[r * kMaxContactRows + s];
    }
    /// Element (r, r).
    [[nodiscard]] double diagonal(std::size_t r) const HAPTIC_RT { return diagonal_[r]; }
    /// Elements (0, 0) to (rows() - 1, rows() - 1).
    [[nodiscard]] const double* diagonal() const HAPTIC_RT { return diagonal_.data(); }
    /// Elements (r, 0) to (r, rows() - 1).
    [[nodiscard]] const double* row(std::size_t r) const HAPTIC_RT { return &elements_[r * kMaxContactRows]; }

  private:
    std::vector<double> elements_;
    std::vector<double> diagonal_;  // once more, without the distance of a row between two
    std::size_t rows_ = 0;
};

/// Friction of one proxy: at least one normal row, all consecutive, directly followed by its two tangential rows. Pairs
/// that overlap or lie beyond the last row have no friction.
struct FrictionRows {
    std::uint16_t first_normal = 0;
    std::uint16_t normals = 0;
    double coefficient = 0.0;  // mu
    bool slides = false;       // output: the tangential force is at its limit, or nothing pushes
};

/// A set of rows.
class RowSet {
  public:
    void insert(std::size_t row) HAPTIC_RT { words_[row / 64] |= std::uint64_t{1} << row % 64; }
    [[nodiscard]] bool contains(std::size_t row) const HAPTIC_RT { return (words_[row / 64] >> row % 64 & 1U) != 0; }
    /// The rows from 64 * word on, the lowest bit first.
    void set_word(std::size_t word, std::uint64_t rows) HAPTIC_RT { words_[word] = rows; }
    /// The rows, 64 to a word, in ascending order.
    [[nodiscard]] std::span<const std::uint64_t> words() const HAPTIC_RT { return words_; }
    friend bool operator==(const RowSet&, const RowSet&) = default;

  private:
    std::array<std::uint64_t, kMaxContactRows / 64> words_{};
};
static_assert(kMaxContactRows % 64 == 0);

/// Cholesky factor of some rows of W. The memory is allocated by the constructor.
class RowFactor {
  public:
    RowFactor();

    /// In the order of the factor.
    [[nodiscard]] std::span<const std::uint16_t> rows() const HAPTIC_RT { return std::span(rows_).first(size()); }
    [[nodiscard]] std::size_t size() const HAPTIC_RT { return cholesky_.size(); }
    void clear() HAPTIC_RT;
    /// Factors those of the rows, in ascending order, that are independent of the ones before. The same rows and
    /// elements give the same bits.
    void make(const ComplianceMatrix& compliance, const RowSet& rows) HAPTIC_RT;

    /// Appends those of the rows, in this order, that are independent of the ones before. `right_side` is b, per row of
    /// W; nullptr: 0.
    void append_independent(const ComplianceMatrix& compliance, std::span<const std::uint16_t> rows,
                            const double* right_side) HAPTIC_RT;
    /// m/N, what remains of W_rr while the rows of the factor stay exact; at most kMinPivot of it: it depends on them.
    [[nodiscard]] double reduce(const ComplianceMatrix& compliance, std::size_t row) HAPTIC_RT;
    /// U^-T W_Sq of the row that was reduced last.
    [[nodiscard]] std::span<const double> reduced() const HAPTIC_RT { return std::span(reduced_).first(size()); }
    /// Appends that row, with what remained of it, and b of the row.
    void append(std::size_t row, double pivot, double right_side) HAPTIC_RT;
    void remove(std::size_t position) HAPTIC_RT;
    /// Sets b, per row of W.
    void set_right_side(const double* b) HAPTIC_RT;
    /// x, size() elements: the solution of W_SS x = b_S.
    void solve(double* x) const HAPTIC_RT { cholesky_.solve(x); }
    /// Rows that were removed since clear(): each adds a rounding.
    [[nodiscard]] int removals() const HAPTIC_RT { return removals_; }
    [[nodiscard]] const CholeskyFactor& cholesky() const HAPTIC_RT { return cholesky_; }
    /// A row of the factor had more compliance than W_rr since clear().
    [[nodiscard]] bool is_padded() const HAPTIC_RT { return padded_; }
    void pad() HAPTIC_RT { padded_ = true; }

    /// A row depends on the active rows if its remaining compliance is below this part of its own: several roundings to
    /// single precision, in which W may have been stored. Rows with the compliance of a surface are far above.
    static constexpr double kMinPivot = 8.0 * std::numeric_limits<float>::epsilon();

  private:
    CholeskyFactor cholesky_;
    std::vector<std::uint16_t> rows_;
    std::vector<double> reduced_;
    std::vector<CholeskyFactor::Elements> reduced_together_;  // scratch of append_independent()
    int removals_ = 0;
    bool padded_ = false;
};

/// Two unit vectors that form a right-handed orthonormal frame with the unit vector n: a continuous function of n
/// except at one pole.
/// @source J. Frisvad, "Building an Orthonormal Basis from a 3D Unit Vector Without Normalization", 2012; exact to
/// rounding at the pole (0, 0, -1) as well.
[[nodiscard]] std::array<Vec3, 2> contact_tangents(const Vec3& n) HAPTIC_RT;

class ContactSolver {
  public:
    /// max_sweeps bounds the time of solve() with friction. Rows of a stiff tool that push against one another converge
    /// slowly: a rigid tool with 37 frictional contacts is within 1 % of its pushes after the default (2.5 % at worst).
    explicit ContactSolver(int max_sweeps = kMaxSweeps);

    struct Result {
        int steps = 0;          // of the active-set method
        int sweeps = 0;         // over all rows; 0 without friction
        double residual = 0.0;  // m, largest violation of a normal row, or change of a displacement in the last sweep
        double stored = 0.0;    // J, V above
    };

    /// Whether the elements of W are those of the last solve(), or of the factor that was lent since then.
    enum class Elements : std::uint8_t { New, Unchanged };

    /// Solves the problem; rows that no element of `friction` claims as tangential are normal rows. Starts from the
    /// last solution if it had the same number of rows; the factor of its rows is kept where W is unchanged: the forces
    /// then depend on the last solution only by rounding, through the order of the factor. Bounded: at most kMaxSteps
    /// active-set steps, one more for each row that leaves several at a time, and max_sweeps sweeps. Finite for finite
    /// rows, also if W is indefinite by the rounding to single precision or planes contradict one another; residual
    /// tells what could not be satisfied. The cones hold exactly. The same calls since the construction or restart()
    /// return the same bits.
    Result solve(const ComplianceMatrix& compliance, std::span<const double> depth,
                 std::span<FrictionRows> friction = {}, Elements elements = Elements::New) HAPTIC_RT;
    /// N, per row, of the last solution.
    [[nodiscard]] std::span<const double> force() const HAPTIC_RT { return std::span(force_).first(rows_); }
    /// m, per row: b - W l of the last solution.
    [[nodiscard]] std::span<const double> deficit() const HAPTIC_RT { return std::span(deficit_).first(rows_); }
    /// The normal rows that push in the last solution.
    [[nodiscard]] RowSet pushing() const HAPTIC_RT;
    /// As if the last solution had been one of `rows` rows without friction, and these had pushed.
    void start(std::size_t rows, const RowSet& pushing) HAPTIC_RT;
    /// Uses this factor, of the rows that push and of the next elements, and keeps it up to date. nullptr: its own.
    void borrow(RowFactor* factor) HAPTIC_RT {
        lent_ = factor;
        only_active_push_ = false;
    }
    /// Forgets the last solution: the rows mean something else now.
    void restart() HAPTIC_RT {
        rows_ = 0;
        only_active_push_ = false;
    }

    static constexpr int kMaxSteps = 400;
    static constexpr int kMaxSweeps = 30;  // what a tick has time for
    // A step of the simulation has more time, and needs it: where a stiff hand closes round an object, its forces are
    // many times their resultant, and what the friction lacks of them would displace the tool by centimetres.
    static constexpr int kMaxStepSweeps = 300;

  private:
    enum class RowState : std::uint8_t {
        Idle,       // normal row that does not push
        Pushes,     // normal row in the active set
        Excluded,   // row without compliance, or a normal row that contradicts active rows
        Tangential  // row of a friction pair
    };

    // solve(), in order.
    void read_rows(const ComplianceMatrix& compliance, std::span<const double> depth,
                   std::span<FrictionRows> friction) HAPTIC_RT;
    void warm_start(const ComplianceMatrix& compliance, std::span<const double> depth, bool same_rows,
                    bool same_elements) HAPTIC_RT;
    [[nodiscard]] std::size_t keep_forces(bool same_rows) HAPTIC_RT;
    [[nodiscard]] RowFactor& factor() HAPTIC_RT { return lent_ != nullptr ? *lent_ : own_factor_; }
    [[nodiscard]] bool can_keep_factor() HAPTIC_RT;
    int solve_normals(const ComplianceMatrix& compliance, int max_steps) HAPTIC_RT;
    void solve_friction(const ComplianceMatrix& compliance, std::span<FrictionRows> friction, Result& result) HAPTIC_RT;
    void bound_energy(std::span<const double> depth) HAPTIC_RT;
    [[nodiscard]] double normal_residual() HAPTIC_RT;

    // Parts of solve_normals(): the first three return the number of steps.
    int settle(const ComplianceMatrix& compliance) HAPTIC_RT;
    int activate_together(const ComplianceMatrix& compliance) HAPTIC_RT;
    [[nodiscard]] std::span<std::uint16_t> find_violated() HAPTIC_RT;
    int activate(const ComplianceMatrix& compliance, std::size_t row, int max_steps) HAPTIC_RT;
    [[nodiscard]] std::size_t most_violated() const HAPTIC_RT;

    // Parts of solve_friction(): sweep() and solve_pair() return the largest change of a displacement.
    [[nodiscard]] double sweep(const ComplianceMatrix& compliance, std::span<FrictionRows> friction) HAPTIC_RT;
    [[nodiscard]] double solve_pair(const ComplianceMatrix& compliance, FrictionRows& friction,
                                    std::size_t first) HAPTIC_RT;
    [[nodiscard]] double exact_force(std::size_t row) const HAPTIC_RT;
    void extrapolate() HAPTIC_RT;

    void compute_free_deficit(const ComplianceMatrix& compliance, std::span<const double> depth) HAPTIC_RT;
    void set_own_compliance(std::size_t row, double own) HAPTIC_RT;
    void append(const ComplianceMatrix& compliance, std::span<const std::uint16_t> rows) HAPTIC_RT;
    void release(std::size_t position) HAPTIC_RT;
    void set_active_forces(const ComplianceMatrix& compliance) HAPTIC_RT;
    void change_active_forces(const ComplianceMatrix& compliance) HAPTIC_RT;
    void subtract_displacements(const ComplianceMatrix& compliance) HAPTIC_RT;
    void set_force(const ComplianceMatrix& compliance, std::size_t row, double force) HAPTIC_RT;

    const ContactKernels* kernels_;
    int max_sweeps_;
    std::size_t rows_ = 0;
    double scale_ = 0.0;                // m, largest depth
    double tolerance_ = 0.0;            // m, violation of a normal row that is rounding
    std::vector<double> force_;         // N, per row
    std::vector<double> free_;          // m, per row: b - W l of the tangential and excluded rows
    std::vector<double> deficit_;       // m, per row: b - (W + own) l
    const double* diagonal_ = nullptr;  // m/N, per row: W_rr; of the compliance that is being solved for
    std::vector<double> own_;           // m/N, per row: added to W_rr in solve_normals() where it depends on others
    std::vector<RowState> state_;       // per row
    RowFactor own_factor_;
    RowFactor* lent_ = nullptr;  // the factor in use is that of the normal rows that push
    bool has_tangents_ = false;
    bool warm_ = false;                  // the factor was kept
    bool only_active_push_ = false;      // no row has a force but those of the factor in use
    AndersonAcceleration acceleration_;  // of the sweeps
    std::vector<std::uint16_t> pair_;    // per first tangential row: index of its friction pair
    std::vector<double> weight_;         // sqrt(m/N), per row: force times weight is comparable between rows
    std::vector<double> held_;           // scratch: N, forces before the sweep
    std::vector<double> share_;          // scratch: N, per active row
    std::vector<const double*> terms_;   // scratch: rows of W, per active row
    std::vector<std::uint16_t> found_;   // scratch: rows
};

}  // namespace haptic
