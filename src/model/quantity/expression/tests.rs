use super::*;
use proptest::prelude::*;

fn value(text: &str, x: f64, y: f64) -> f64 {
    Expression::parse(text)
        .unwrap_or_else(|error| panic!("{error}"))
        .at([x, y])
}

#[test]
fn expressions_evaluate_correctly() {
    assert_eq!(value("-x^2", 3.0, 0.0), -9.0);
    assert_eq!(value("2*(-x^2)", 3.0, 0.0), -18.0);
    assert_eq!(value("2*-x", 3.0, 0.0), -6.0);
    assert_eq!(value("2 - -x", 3.0, 0.0), 5.0);
    assert_eq!(value("1/-x*2 + +x", 4.0, 0.0), 3.5);
    assert_eq!(value("--x", 4.0, 0.0), 4.0);
    assert_eq!(value("-2e7 * max(0, 1 - x / 1.5)", 0.75, 0.0), -1e7);
    assert_eq!(value("1e-3 + 2.5E+2*y", 0.0, 2.0), 500.001);
    assert_eq!(value("1.e1 + 1.", 0.0, 2.0), 11.0);
    assert_eq!(value("min(-1, x) - .5", 3.0, 0.0), -1.5);
    assert_eq!(value("x^-2", 2.0, 0.0), 0.25);
    assert_eq!(value("2^-x^2", 2.0, 0.0), 0.0625);
    assert_eq!(value("2^3^2", 0.0, 0.0), 512.0);
    assert_eq!(value("x^0.5^-1", 3.0, 0.0), 9.0);
    assert_eq!(value("y - x - 1", 1.0, 5.0), 3.0);
    assert_eq!(value("8 / x / 2", 2.0, 5.0), 2.0);
    assert_eq!(value("7", 1.0, 5.0), 7.0);
    assert_eq!(value("max(0, min(1, 7 - x))", 6.5, 0.0), 0.5);
    assert_eq!(value("max(1, x, y, -3) + min(x,y,2)", 4.0, 5.0), 7.0);
    assert_eq!(value("(sqrt((x)^2 + ((y)^2)))", 3.0, 4.0), 5.0);
    assert_eq!(value("sin(PI*x) + sin(pi*x) + sin(π * x)", 0.5, 0.0), 3.0);
    assert_eq!(value("ln(e) + log(E)", 0.5, 0.0), 2.0);
    assert_eq!(value("2*e - e*2 + 1e0", 0.5, 0.0), 1.0);
    assert_eq!(value("sign(x) + sign(-2) + signum(3)", 0.0, 0.0), 0.0);
    assert_eq!(value("atan2(y, x)", 0.0, 2.0), PI / 2.0);
    assert!(value("sqrt(x)", -1.0, 0.0).is_nan());
}

#[test]
fn nonsense_is_refused_with_its_column() {
    for (text, column, message) in [
        (
            "x +",
            4,
            "expected a number, a name or \"(\", found the end",
        ),
        ("2*/x", 3, "found \"/\""),
        (
            " z + 1",
            2,
            "unknown name \"z\": only the coordinates x and y vary",
        ),
        (
            "1 + sni(x)",
            5,
            "unknown name \"sni\": did you mean \"sin\"?",
        ),
        ("X", 1, "did you mean \"x\"?"),
        ("Sqrt(x)", 1, "did you mean \"sqrt\"?"),
        ("", 1, "found the end"),
        ("   ", 4, "found the end"),
        ("1 2", 3, "expected an operator, found \"2\""),
        ("2x", 2, "expected an operator, found \"x\""),
        ("2e", 2, "expected an operator, found \"e\""),
        ("1..2", 3, "expected an operator"),
        (".", 1, "expected a number, found \".\""),
        (
            "sin(x",
            6,
            "expected an operator or \")\" (sin takes one value), found the end",
        ),
        ("sin(x, y)", 6, "sin takes one value"),
        ("sin x", 5, "expected \"(\" after sin, found \"x\""),
        (
            "sin()",
            5,
            "expected a number, a name or \"(\", found \")\"",
        ),
        ("atan2(x)", 8, "atan2 takes two values), found \")\""),
        ("atan2(x, y, 1)", 11, "atan2 takes two values"),
        ("max(x)", 6, "\",\" (max takes two values or more)"),
        ("(x, y)", 3, "an operator or \")\", found \",\""),
        ("x)", 2, "expected an operator, found \")\""),
        ("x(2)", 2, "expected an operator"),
        ("x ; y", 3, "found \";\""),
        ("x**2", 3, "found \"*\""),
        ("π π", 3, "found \"π\""),
        ("1 + 1e999", 5, "too large"),
    ] {
        match Expression::<2>::parse(text) {
            Ok(_) => panic!("accepted: {text}"),
            Err(error) => assert!(
                error.contains(&format!("\", column {column}: ")) && error.contains(message),
                "{error}\nnot {column}: {message}"
            ),
        }
    }
}

#[test]
fn nesting_ends_in_an_error() {
    for text in ["(", "-", "2^", "sin(", "max(1,", "1+(", "1-"] {
        let deep = format!("{}x", text.repeat(100_000));
        match Expression::<2>::parse(&deep) {
            // A chain that is evaluated as it goes does not nest.
            Ok(_) => assert_eq!(text, "1-"),
            Err(error) => assert!(
                error.contains("nested too deeply") && error.len() < 300,
                "{error}"
            ),
        }
    }
    // An accepted expression can also be evaluated.
    let deepest = format!("{}x{}", "(".repeat(DEPTH - 1), ")".repeat(DEPTH - 1));
    assert_eq!(value(&deepest, 2.0, 0.0), 2.0);
    let powers = format!("{}x", "1^".repeat(DEPTH - 1));
    assert_eq!(value(&powers, 2.0, 0.0), 1.0);
    let unknown = "q".repeat(1 << 20);
    assert!(Expression::<2>::parse(&unknown).is_err_and(|error| error.len() < 400));
}

#[test]
fn space_has_a_third_coordinate() {
    let value = |text: &str| Expression::parse(text).map(|e| e.at([2.0, 3.0, 5.0]));
    assert_eq!(value("x + 10 * y + 100 * z"), Ok(532.0));
    assert_eq!(value("max(x, y, z) - min(z, 1)"), Ok(4.0));
    let told = |text: &str| value(text).expect_err("it is wrong");
    assert!(told("w").ends_with("only the coordinates x, y and z vary"));
    assert!(told("1 + Z").ends_with("column 5: unknown name \"Z\": did you mean \"z\"?"));
    // In the plane z is not a name, and is not proposed.
    let plane = Expression::<2>::parse("Z").expect_err("it is wrong");
    assert!(
        plane.ends_with("only the coordinates x and y vary"),
        "{plane}"
    );
}

/// An expression before it is written down.
#[derive(Clone, Debug)]
enum Tree {
    Number(f64),
    Coordinate(bool),
    Minus(Box<Tree>),
    Operation(char, Box<Tree>, Box<Tree>),
    Call(&'static str, Vec<Tree>),
}

impl Tree {
    fn value(&self, x: f64, y: f64) -> f64 {
        match self {
            Self::Number(value) => *value,
            Self::Coordinate(first) => [y, x][usize::from(*first)],
            Self::Minus(a) => -a.value(x, y),
            Self::Operation(sign, a, b) => {
                let (a, b) = (a.value(x, y), b.value(x, y));
                match sign {
                    '+' => a + b,
                    '-' => a - b,
                    '*' => a * b,
                    '/' => a / b,
                    _ => a.powf(b),
                }
            }
            Self::Call(name, values) => {
                let values: Vec<f64> = values.iter().map(|v| v.value(x, y)).collect();
                match (*name, &values[..]) {
                    ("abs", [a]) => a.abs(),
                    ("sqrt", [a]) => a.sqrt(),
                    ("cos", [a]) => a.cos(),
                    ("exp", [a]) => a.exp(),
                    ("atan2", [a, b]) => a.atan2(*b),
                    ("min", all) => all.iter().copied().reduce(f64::min).unwrap_or(f64::NAN),
                    ("max", all) => all.iter().copied().reduce(f64::max).unwrap_or(f64::NAN),
                    _ => f64::NAN,
                }
            }
        }
    }

    /// With brackets around everything.
    fn plain(&self) -> String {
        match self {
            Self::Minus(a) => format!("(-{})", a.plain()),
            Self::Operation(sign, a, b) => format!("({}{sign}{})", a.plain(), b.plain()),
            Self::Call(name, values) => {
                let values: Vec<String> = values.iter().map(Self::plain).collect();
                format!("({name}({}))", values.join(","))
            }
            _ => format!("({})", self.terse(0)),
        }
    }

    /// With brackets only where the tree would change without them: where this operator binds less than required.
    fn terse(&self, least: u8) -> String {
        let (binds, text) = match self {
            Self::Number(value) => (5, format!("{value:e}")),
            Self::Coordinate(first) => (5, ["y", "x"][usize::from(*first)].to_owned()),
            Self::Minus(a) => (3, format!("-{}", a.terse(3))),
            Self::Operation(sign, a, b) => {
                let (binds, before, behind) = match sign {
                    '+' | '-' => (1, 1, 2),
                    '*' | '/' => (2, 2, 3),
                    _ => (4, 5, 3),
                };
                (
                    binds,
                    format!("{} {sign}{}", a.terse(before), b.terse(behind)),
                )
            }
            Self::Call(name, values) => {
                let values: Vec<String> = values.iter().map(|v| v.terse(0)).collect();
                (5, format!("{name} ({})", values.join(", ")))
            }
        };
        if binds < least {
            format!("({text})")
        } else {
            text
        }
    }
}

fn trees() -> impl Strategy<Value = Tree> {
    let leaf = prop_oneof![
        prop::sample::select(vec![0.0, 0.5, 1.0, 2.0, 3.0, 1.5e-3, 2.5e7]).prop_map(Tree::Number),
        any::<bool>().prop_map(Tree::Coordinate),
    ];
    leaf.prop_recursive(6, 40, 3, |tree| {
        let signs = prop::sample::select(vec!['+', '-', '*', '/', '^']);
        let boxed = tree.clone().prop_map(Box::new);
        prop_oneof![
            1 => boxed.clone().prop_map(Tree::Minus),
            4 => (signs, boxed.clone(), boxed)
                .prop_map(|(sign, a, b)| Tree::Operation(sign, a, b)),
            1 => (prop::sample::select(vec!["abs", "sqrt", "cos", "exp"]), tree.clone())
                .prop_map(|(name, a)| Tree::Call(name, vec![a])),
            1 => (tree.clone(), tree.clone()).prop_map(|(a, b)| Tree::Call("atan2", vec![a, b])),
            1 => (
                prop::sample::select(vec!["min", "max"]),
                prop::collection::vec(tree, 2..4)
            ).prop_map(|(name, values)| Tree::Call(name, values)),
        ]
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn brackets_are_needed_nowhere_else(tree in trees(), x in -2.0..2.0, y in -2.0..2.0) {
        let expected = tree.value(x, y);
        for text in [tree.plain(), tree.terse(0)] {
            let found = value(&text, x, y);
            prop_assert!(
                found.to_bits() == expected.to_bits() || found.is_nan() && expected.is_nan(),
                "{} is {}, not {}", text, found, expected
            );
        }
    }
}
