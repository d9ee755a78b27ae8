// Expressions: lexer, parser by precedence, and a graph that folds constants and shares equal parts.
// SPDX-License-Identifier: MIT
#include "libvkt/operations/voxels/expression.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"

#include <bit>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <tuple>

namespace vkt {
namespace {

/// What an operation makes of numbers.
double folded(Op op, double a, double b, double c) {
    auto const truth = [](bool is) { return is ? 1.0 : 0.0; };
    switch (op) {
    case Op::neg:
        return -a;
    case Op::abs:
        return std::fabs(a);
    case Op::sqrt:
        return std::sqrt(a);
    case Op::exp:
        return std::exp(a);
    case Op::log:
        return std::log(a);
    case Op::log10:
        return std::log10(a);
    case Op::log2:
        return std::log2(a);
    case Op::exp2:
        return std::exp2(a);
    case Op::cbrt:
        return std::cbrt(a);
    case Op::sin:
        return std::sin(a);
    case Op::cos:
        return std::cos(a);
    case Op::tan:
        return std::tan(a);
    case Op::asin:
        return std::asin(a);
    case Op::acos:
        return std::acos(a);
    case Op::sinh:
        return std::sinh(a);
    case Op::cosh:
        return std::cosh(a);
    case Op::tanh:
        return std::tanh(a);
    case Op::erf:
        return std::erf(a);
    case Op::atan:
        return std::atan(a);
    case Op::floor:
        return std::floor(a);
    case Op::ceil:
        return std::ceil(a);
    case Op::round:
        return std::nearbyint(a);
    case Op::trunc:
        return std::trunc(a);
    case Op::sign:
        return a > 0 ? 1 : a < 0 ? -1 : a;
    case Op::not_:
        return truth(a == 0);
    case Op::isnan:
        return truth(std::isnan(a));
    case Op::isinf:
        return truth(std::isinf(a));
    case Op::isfinite:
        return truth(std::isfinite(a));
    case Op::add:
        return a + b;
    case Op::sub:
        return a - b;
    case Op::mul:
        return a * b;
    case Op::div:
        return a / b;
    case Op::min:
        return a < b || std::isnan(a) ? a : b;
    case Op::max:
        return a > b || std::isnan(a) ? a : b;
    case Op::pow:
        return std::pow(a, b);
    case Op::atan2:
        return std::atan2(a, b);
    case Op::fmod:
        return std::fmod(a, b);
    case Op::mod: {
        double const rest = std::fmod(a, b);
        return rest != 0 && (rest < 0) != (b < 0) ? rest + b : rest;
    }
    case Op::hypot:
        return std::hypot(a, b);
    case Op::lt:
        return truth(a < b);
    case Op::le:
        return truth(a <= b);
    case Op::eq:
        return truth(a == b);
    case Op::ne:
        return truth(a != b);
    case Op::and_:
        return truth(a != 0 && b != 0);
    case Op::or_:
        return truth(a != 0 || b != 0);
    case Op::select:
        return a != 0 ? b : c;
    case Op::clamp:
        return a < b ? b : a > c ? c : a;
    default: // leaves
        return a;
    }
}

/// Nodes that are asked for twice are made once; operations on numbers become numbers.
class Graph {
public:
    std::vector<Node> const& nodes() const { return nodes_; }

    int number(double value) {
        Node node;
        node.number = value;
        return add(node);
    }
    int leaf(Op op) {
        Node node;
        node.op = op;
        return add(node);
    }
    int voxel(int volume, Index3 offset) {
        Node node;
        node.op = Op::voxel;
        node.volume = volume;
        node.offset = offset;
        return add(node);
    }
    int make(Op op, int a, int b = -1, int c = -1) {
        auto const numeral = [&](int i) { return i < 0 || at(i).op == Op::number; };
        auto const value = [&](int i) { return i < 0 ? 0 : at(i).number; };
        if (numeral(a) && numeral(b) && numeral(c)) return number(folded(op, value(a), value(b), value(c)));
        if (op == Op::select && numeral(a)) return value(a) != 0 ? b : c;
        if (op == Op::pow && numeral(b)) {
            double const n = value(b);
            if (n == 0) return number(1);
            if (n == 1) return a;
            if (n == 2 || n == 3 || n == 4) {
                int const square = make(Op::mul, a, a);
                return n == 2 ? square : make(Op::mul, square, n == 3 ? a : square);
            }
        }
        Node node;
        node.op = op;
        node.in = {a, b, c};
        return add(node);
    }
    /// The nodes that the result needs.
    std::vector<Node> needed(int result) const {
        std::vector<char> used(nodes_.size());
        used[static_cast<std::size_t>(result)] = 1;
        for (std::size_t i = nodes_.size(); i-- > 0;)
            if (used[i] != 0)
                for (int const in : nodes_[i].in)
                    if (in >= 0) used[static_cast<std::size_t>(in)] = 1;
        std::vector<Node> kept;
        std::vector<int> place(nodes_.size(), -1);
        for (std::size_t i = 0; i <= static_cast<std::size_t>(result); ++i) {
            if (used[i] == 0) continue;
            Node node = nodes_[i];
            for (int& in : node.in)
                if (in >= 0) in = place[static_cast<std::size_t>(in)];
            place[i] = static_cast<int>(kept.size());
            kept.push_back(node);
        }
        return kept;
    }

private:
    Node const& at(int i) const { return nodes_[static_cast<std::size_t>(i)]; }
    int add(Node const& n) {
        Key const key{n.op, n.in, std::bit_cast<std::uint64_t>(n.number), n.volume, n.offset.x, n.offset.y, n.offset.z};
        auto const [entry, is_new] = known_.try_emplace(key, static_cast<int>(nodes_.size()));
        if (!is_new) return entry->second;
        if (nodes_.size() >= Expression::most_nodes)
            throw Error(ErrorKind::usage,
                        text("the expression has more than ", static_cast<std::int64_t>(Expression::most_nodes),
                             " different parts"),
                        "compute it in several steps");
        nodes_.push_back(n);
        return entry->second;
    }

    using Key = std::tuple<Op, std::array<int, 3>, std::uint64_t, int, std::int64_t, std::int64_t, std::int64_t>;
    std::vector<Node> nodes_;
    std::map<Key, int> known_;
};

enum class TokenKind : std::uint8_t { number, name, sign, end };

struct Token {
    TokenKind kind = TokenKind::end;
    std::string_view word;
    std::size_t at = 0; ///< first byte
};

bool is_digit(char c) { return c >= '0' && c <= '9'; }
bool is_letter(char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_'; }

class Lexer {
public:
    explicit Lexer(std::string_view text) : text_(text) {}

    Token next() {
        while (at_ < text_.size() && std::string_view(" \t\n\r").find(text_[at_]) != std::string_view::npos) ++at_;
        std::size_t const begin = at_;
        if (begin == text_.size()) return {TokenKind::end, {}, begin};
        char const c = text_[at_];
        if (is_digit(c) || (c == '.' && is_digit(peek(1)))) {
            take_number();
            return {TokenKind::number, text_.substr(begin, at_ - begin), begin};
        }
        if (is_letter(c)) {
            while (is_letter(peek(0)) || is_digit(peek(0))) ++at_;
            return {TokenKind::name, text_.substr(begin, at_ - begin), begin};
        }
        for (std::string_view const sign : {"**", "&&", "||", "==", "!=", "<=", ">="})
            if (text_.substr(at_).starts_with(sign)) {
                at_ += 2;
                return {TokenKind::sign, text_.substr(begin, 2), begin};
            }
        at_ += first_character(text_.substr(at_)).bytes;
        return {TokenKind::sign, text_.substr(begin, at_ - begin), begin};
    }

private:
    char peek(std::size_t ahead) const { return at_ + ahead < text_.size() ? text_[at_ + ahead] : '\0'; }
    void take_number() {
        while (is_digit(peek(0)) || peek(0) == '.') ++at_;
        if (peek(0) != 'e' && peek(0) != 'E') return;
        std::size_t const sign = peek(1) == '+' || peek(1) == '-' ? 1 : 0;
        if (!is_digit(peek(1 + sign))) return;
        at_ += 1 + sign;
        while (is_digit(peek(0))) ++at_;
    }

    std::string_view text_;
    std::size_t at_ = 0;
};

struct Function {
    std::string_view name;
    Op op;
    int least, most;
};

constexpr int any_number = 1 << 16;
constexpr Function functions[] = {
    {"abs", Op::abs, 1, 1},     {"min", Op::min, 2, any_number}, {"max", Op::max, 2, any_number},
    {"clamp", Op::clamp, 3, 3}, {"sqrt", Op::sqrt, 1, 1},        {"exp", Op::exp, 1, 1},
    {"log", Op::log, 1, 1},     {"log10", Op::log10, 1, 1},      {"pow", Op::pow, 2, 2},
    {"sin", Op::sin, 1, 1},     {"cos", Op::cos, 1, 1},          {"tan", Op::tan, 1, 1},
    {"asin", Op::asin, 1, 1},   {"acos", Op::acos, 1, 1},        {"atan", Op::atan, 1, 1},
    {"atan2", Op::atan2, 2, 2}, {"floor", Op::floor, 1, 1},      {"ceil", Op::ceil, 1, 1},
    {"round", Op::round, 1, 1}, {"trunc", Op::trunc, 1, 1},      {"fmod", Op::fmod, 2, 2},
    {"mod", Op::mod, 2, 2},     {"hypot", Op::hypot, 2, 2},      {"sign", Op::sign, 1, 1},
    {"step", Op::le, 2, 2},     {"select", Op::select, 3, 3},    {"where", Op::select, 3, 3},
    {"isnan", Op::isnan, 1, 1}, {"isinf", Op::isinf, 1, 1},      {"isfinite", Op::isfinite, 1, 1},
    {"log2", Op::log2, 1, 1},   {"exp2", Op::exp2, 1, 1},        {"cbrt", Op::cbrt, 1, 1},
    {"sinh", Op::sinh, 1, 1},   {"cosh", Op::cosh, 1, 1},        {"tanh", Op::tanh, 1, 1},
    {"erf", Op::erf, 1, 1},     {"fract", Op::floor, 1, 1},      {"lerp", Op::mul, 3, 3},
    {"xor", Op::ne, 2, 2},
};

struct Constant {
    std::string_view name;
    double value;
};
constexpr Constant constants[] = {{"pi", 3.14159265358979323846},
                                  {"e", 2.71828182845904523536},
                                  {"nan", std::numeric_limits<double>::quiet_NaN()},
                                  {"inf", std::numeric_limits<double>::infinity()}};

struct Leaf {
    std::string_view name;
    Op op;
};
constexpr Leaf leaves[] = {{"x", Op::x},   {"y", Op::y},   {"z", Op::z},   {"nx", Op::nx}, {"ny", Op::ny},
                           {"nz", Op::nz}, {"wx", Op::wx}, {"wy", Op::wy}, {"wz", Op::wz}};

template <class List> auto const* find(List const& list, std::string_view name) {
    for (auto const& entry : list)
        if (entry.name == name) return &entry;
    return static_cast<decltype(&list[0])>(nullptr);
}

/// Binding strength of operators between two values; `not` binds as if it were not_strength.
struct Binary {
    std::string_view sign;
    Op op;
    int strength;
    bool turned; ///< a > b is b < a
};
constexpr int comparison = 4, not_strength = 4;
constexpr Binary binaries[] = {
    {"||", Op::or_, 1, false},         {"or", Op::or_, 1, false},        {"&&", Op::and_, 2, false},
    {"and", Op::and_, 2, false},       {"<", Op::lt, comparison, false}, {"<=", Op::le, comparison, false},
    {">", Op::lt, comparison, true},   {">=", Op::le, comparison, true}, {"==", Op::eq, comparison, false},
    {"!=", Op::ne, comparison, false}, {"+", Op::add, 5, false},         {"-", Op::sub, 5, false},
    {"*", Op::mul, 6, false},          {"/", Op::div, 6, false}};

class Parser {
public:
    explicit Parser(std::string_view text) : text_(text), lexer_(text) { advance(); }

    int whole() {
        if (token_.kind == TokenKind::end)
            throw Error(ErrorKind::usage, "the expression is empty", "for example 'v * 2 + 1'");
        int const result = choice();
        if (token_.kind != TokenKind::end) unexpected("an operator or the end");
        return result;
    }
    Graph const& graph() const { return graph_; }
    int volumes() const { return volumes_; }
    bool says_infinite() const { return says_infinite_; }

private:
    class Deeper {
    public:
        explicit Deeper(Parser& parser) : parser_(parser) {
            if (++parser.depth_ > Expression::most_nesting)
                parser.fail(parser.token_, text("nested more than ", Expression::most_nesting, " deep"),
                            "compute it in several steps");
        }
        ~Deeper() { --parser_.depth_; }
        Deeper(Deeper const&) = delete;
        Deeper& operator=(Deeper const&) = delete;

    private:
        Parser& parser_;
    };

    [[noreturn]] void fail(Token const& token, std::string const& what, std::string const& hint = {}) const {
        std::int64_t column = 1;
        for (char const c : text_.substr(0, token.at))
            column += (static_cast<unsigned char>(c) & 0xc0U) != 0x80U ? 1 : 0;
        std::string const word =
            token.kind == TokenKind::end ? "the end" : text("'", printable(token.word.substr(0, 40)), "'");
        throw Error(ErrorKind::usage, text("expression, column ", column, ", at ", word, ": ", what), hint);
    }
    [[noreturn]] void unexpected(std::string_view wanted) const {
        std::string hint;
        if (token_.word == "=") hint = "== compares";
        if (token_.word == "%") hint = "the rest of a division is mod(a, b), or fmod(a, b) with the sign of a";
        if (token_.word == "&" || token_.word == "|") hint = "logic is said with and, or, not";
        if (token_.kind == TokenKind::number || token_.kind == TokenKind::name || token_.word == "(")
            hint = "a product is said with *";
        fail(token_, text(wanted, " is expected"), hint);
    }
    void advance() { token_ = lexer_.next(); }
    bool is(std::string_view sign) const {
        return (token_.kind == TokenKind::sign || token_.kind == TokenKind::name) && token_.word == sign;
    }
    bool take(std::string_view sign) {
        if (!is(sign)) return false;
        advance();
        return true;
    }
    void expect(std::string_view sign) {
        if (!take(sign)) unexpected(text("'", sign, "'"));
    }

    int choice() {
        Deeper const deeper(*this);
        int const condition = binary(1);
        if (!take("?")) return condition;
        int const yes = choice();
        expect(":");
        int const no = choice();
        return graph_.make(Op::select, condition, yes, no);
    }

    int binary(int least) {
        int left = operand();
        while (true) {
            Binary const* op = nullptr;
            for (Binary const& candidate : binaries)
                if (is(candidate.sign)) op = &candidate;
            if (op == nullptr || op->strength < least) return left;
            advance();
            int const right = binary(op->strength + 1);
            left = op->turned ? graph_.make(op->op, right, left) : graph_.make(op->op, left, right);
            if (op->strength != comparison) continue;
            for (Binary const& next : binaries)
                if (next.strength == comparison && is(next.sign))
                    fail(token_, "comparisons do not chain", "say a < b and b < c");
        }
    }

    int operand() {
        Deeper const deeper(*this);
        if (take("not")) return graph_.make(Op::not_, binary(not_strength));
        if (take("!")) return graph_.make(Op::not_, operand());
        if (take("-")) return graph_.make(Op::neg, operand());
        if (take("+")) return operand();
        int const base = primary();
        if (take("^") || take("**")) return graph_.make(Op::pow, base, operand());
        return base;
    }

    int primary() {
        Token const token = token_;
        if (token.kind == TokenKind::number) {
            advance();
            if (!is_number(token.word)) fail(token, "not a number");
            return graph_.number(parse_double(token.word));
        }
        if (take("(")) {
            int const inside = choice();
            expect(")");
            return inside;
        }
        if (token.kind != TokenKind::name || is("and") || is("or")) unexpected("a value");
        advance();
        if (auto const* const function = find(functions, token.word)) return call(token, *function);
        if (auto const letter = volume_letters.find(token.word);
            token.word.size() == 1 && letter != std::string_view::npos)
            return voxel(static_cast<int>(letter));
        int const value = named(token);
        if (is("(")) fail(token, "not a function", "a product is said with *");
        if (is("[")) fail(token, "not a volume: only these have neighbours", "for example v[-1,0,0]");
        return value;
    }

    int named(Token const& token) {
        if (auto const* const constant = find(constants, token.word)) {
            says_infinite_ = says_infinite_ || !std::isfinite(constant->value);
            return graph_.number(constant->value);
        }
        if (auto const* const leaf = find(leaves, token.word)) return graph_.leaf(leaf->op);
        std::vector<std::string> names{"v", "and", "or", "not"};
        for (auto const& f : functions) names.emplace_back(f.name);
        for (auto const& c : constants) names.emplace_back(c.name);
        for (auto const& l : leaves) names.emplace_back(l.name);
        std::string const near = nearest_name(lower_case(token.word), names);
        std::string const all = "v, a, b, … are voxels; x y z nx ny nz wx wy wz positions; see 'man vkt-transform'";
        fail(token, "nothing of that name is known", near.empty() ? all : text("did you mean '", near, "'?"));
    }

    int call(Token const& token, Function const& function) {
        if (!is("(")) fail(token, "a function needs its arguments in parentheses");
        advance();
        std::array<int, 3> in{-1, -1, -1};
        int n = 0;
        if (!is(")")) {
            do {
                int const value = choice();
                if (function.most == any_number && n >= 2) { // min and max of any number
                    in[0] = graph_.make(function.op, in[0], in[1]);
                    in[1] = value;
                } else if (n < 3) {
                    in[static_cast<std::size_t>(n)] = value;
                }
                ++n;
            } while (take(","));
        }
        expect(")");
        if (n < function.least || n > function.most)
            fail(token, text("takes ", function.least, function.most > function.least ? " or more" : "",
                             function.least == 1 ? " argument" : " arguments", ", not ", n));
        return made(function, in);
    }

    /// Some functions are made of others.
    int made(Function const& function, std::array<int, 3> const& in) {
        if (function.name == "fract") return graph_.make(Op::sub, in[0], graph_.make(Op::floor, in[0]));
        if (function.name == "xor")
            return graph_.make(Op::ne, graph_.make(Op::not_, in[0]), graph_.make(Op::not_, in[1]));
        if (function.name == "lerp")
            return graph_.make(Op::add, in[0], graph_.make(Op::mul, in[2], graph_.make(Op::sub, in[1], in[0])));
        return graph_.make(function.op, in[0], in[1], in[2]);
    }

    int voxel(int volume) {
        volumes_ = std::max(volumes_, volume + 1);
        Index3 offset;
        if (is("(")) unexpected("an operator");
        if (take("[")) {
            for (int axis = 0; axis < 3; ++axis) {
                if (axis > 0) expect(",");
                offset[axis] = signed_integer();
            }
            expect("]");
        }
        return graph_.voxel(volume, offset);
    }

    std::int64_t signed_integer() {
        bool const negative = take("-");
        if (!negative) take("+");
        Token const token = token_;
        if (token.kind != TokenKind::number || token.word.find_first_not_of("0123456789") != std::string_view::npos)
            fail(token, "the offset of a neighbour is a whole number", "for example v[-1,0,0], along x, y and z");
        advance();
        double const value = parse_double(token.word);
        if (value > static_cast<double>(Expression::most_offset))
            fail(token, text("neighbours are at most ", Expression::most_offset, " voxels away"));
        return negative ? -static_cast<std::int64_t>(value) : static_cast<std::int64_t>(value);
    }

    std::string_view text_;
    Lexer lexer_;
    Token token_;
    Graph graph_;
    int depth_ = 0, volumes_ = 1;
    bool says_infinite_ = false;
};

} // namespace

Expression Expression::parse(std::string_view words) {
    if (words.size() > most_characters)
        throw Error(ErrorKind::usage,
                    text("the expression has more than ", static_cast<std::int64_t>(most_characters), " characters"),
                    "compute it in several steps");
    Parser parser(words);
    Expression result;
    int const root = parser.whole();
    result.nodes_ = parser.graph().needed(root);
    result.volumes_ = parser.volumes();
    result.says_infinite_ = parser.says_infinite();
    return result;
}

Expression Expression::with_extent(Index3 dims) const {
    Graph graph;
    std::vector<int> place;
    auto const at = [&](int i) { return i < 0 ? -1 : place[static_cast<std::size_t>(i)]; };
    for (Node const& node : nodes_) {
        if (is_extent(node.op))
            place.push_back(
                graph.number(static_cast<double>(dims[static_cast<int>(node.op) - static_cast<int>(Op::nx)])));
        else if (node.op == Op::number)
            place.push_back(graph.number(node.number));
        else if (node.op == Op::voxel)
            place.push_back(graph.voxel(node.volume, node.offset));
        else if (operands_of(node.op) == 0)
            place.push_back(graph.leaf(node.op));
        else
            place.push_back(graph.make(node.op, at(node.in[0]), at(node.in[1]), at(node.in[2])));
    }
    Expression result = *this;
    result.nodes_ = graph.needed(place.back());
    return result;
}

Box offsets_of(Expression const& expression, int volume) {
    Box box;
    for (Node const& node : expression.nodes()) {
        if (node.op != Op::voxel || node.volume != volume) continue;
        for (int axis = 0; axis < 3; ++axis) {
            box.lower[axis] = std::min(box.lower[axis], node.offset[axis]);
            box.upper[axis] = std::max(box.upper[axis], node.offset[axis]);
        }
    }
    return box;
}

} // namespace vkt
