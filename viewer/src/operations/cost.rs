//! What an expression or a store of naga's intermediate representation counts for.

use crate::operations::counts::OperationCounts;
use naga::valid::FunctionInfo;
use naga::{
    AddressSpace, BinaryOperator, Expression, Function, Handle, MathFunction, Module, ScalarKind, TypeInner,
    UnaryOperator,
};

/// Products and sums of an arc tangent or arc cosine beside its one special operation, as compilers expand them.
const ARC_OPERATIONS: u64 = 10;

/// A function whose expressions are counted.
pub(super) struct Counted<'a> {
    pub module: &'a Module,
    pub function: &'a Function,
    pub info: &'a FunctionInfo,
}

/// What a pointer leads to.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Memory {
    Storage,
    /// An array of one thread, by a computed index.
    ThreadArray,
    Other,
}

impl Counted<'_> {
    /// Returns what an expression counts for when it is evaluated.
    pub(super) fn expression(&self, handle: Handle<Expression>) -> OperationCounts {
        let none = OperationCounts::default();
        let (width, is_float) = self.width(handle);
        let plain = |count: u64, is_float: bool| match is_float {
            true => OperationCounts { float: count, ..none },
            false => OperationCounts { integer: count, ..none },
        };
        match self.function.expressions[handle] {
            Expression::Load { pointer } => self.access(pointer),
            Expression::Access { base, .. } => match self.inner(base) {
                TypeInner::Array { .. } => OperationCounts { array_words: width, ..none },
                _ => plain(1, false),
            },
            Expression::Binary { op, left, right } => self.binary(op, left, right, width),
            Expression::Unary { op: UnaryOperator::Negate, .. } => plain(if is_float { 0 } else { width }, false),
            Expression::Unary { .. } => plain(width, false),
            Expression::Select { .. } => plain(width, is_float),
            Expression::Relational { argument, .. } => plain(self.width(argument).0 - 1, false),
            Expression::Math { fun, arg, .. } => self.math(fun, arg, width),
            Expression::As { convert: Some(_), .. } => plain(width, false),
            _ => none,
        }
    }

    /// Returns what reading or writing through a pointer counts for; `pointer` is where the value lies.
    fn access(&self, pointer: Handle<Expression>) -> OperationCounts {
        let words = self.pointed_words(pointer);
        let none = OperationCounts::default();
        match self.memory(pointer) {
            Memory::Storage => OperationCounts { loaded_words: words, ..none },
            Memory::ThreadArray => OperationCounts { array_words: words, ..none },
            Memory::Other => none,
        }
    }

    /// Returns what a store through `pointer` counts for.
    pub(super) fn store(&self, pointer: Handle<Expression>) -> OperationCounts {
        let read = self.access(pointer);
        OperationCounts { loaded_words: 0, stored_words: read.loaded_words, ..read }
    }

    fn binary(
        &self,
        op: BinaryOperator,
        left: Handle<Expression>,
        right: Handle<Expression>,
        width: u64,
    ) -> OperationCounts {
        let none = OperationCounts::default();
        let [(left_width, is_float), (right_width, _)] = [left, right].map(|side| self.width(side));
        let matrices = [left, right].map(|side| matches!(self.inner(side), TypeInner::Matrix { .. }));
        if op == BinaryOperator::Multiply && matrices.contains(&true) && left_width.min(right_width) > 1 {
            // Each number of the result is a sum of products over the inner dimension.
            let inner = match matrices {
                [true, true] => ((left_width * right_width) as f64 / width as f64).sqrt() as u64,
                _ => left_width.max(right_width) / width,
            };
            return OperationCounts { float: width * (2 * inner - 1), ..none };
        }
        // A comparison has a boolean result and the operands' numbers.
        let count = left_width.max(right_width);
        match (op, is_float) {
            (BinaryOperator::Divide, true) => OperationCounts { special: count, float: count, ..none },
            (BinaryOperator::Modulo, true) => OperationCounts { special: count, float: 3 * count, ..none },
            (_, true) => OperationCounts { float: count, ..none },
            (_, false) => OperationCounts { integer: count, ..none },
        }
    }

    fn math(&self, fun: MathFunction, arg: Handle<Expression>, width: u64) -> OperationCounts {
        use MathFunction as F;
        let (of, is_float) = self.width(arg);
        let of_numbers = |float: u64, special: u64, integer: u64| match is_float {
            true => OperationCounts { float, special, integer, ..OperationCounts::default() },
            false => OperationCounts { special, integer: integer + float, ..OperationCounts::default() },
        };
        match fun {
            // Modifiers of operands.
            F::Abs | F::Saturate if is_float => of_numbers(0, 0, 0),
            F::Transpose => of_numbers(0, 0, 0),
            F::Clamp | F::Fma | F::Step => of_numbers(2 * width, 0, 0),
            F::Mix => of_numbers(3 * width, 0, 0),
            F::SmoothStep => of_numbers(6 * width, width, 0),
            F::Dot => of_numbers(2 * of - 1, 0, 0),
            F::Cross => of_numbers(9, 0, 0),
            F::Length => of_numbers(2 * of - 1, 1, 0),
            F::Distance => of_numbers(3 * of - 1, 1, 0),
            F::Normalize => of_numbers(3 * of - 1, 1, 0),
            F::Reflect => of_numbers(4 * of, 0, 0),
            F::Sqrt | F::InverseSqrt | F::Exp2 | F::Log2 | F::Sin | F::Cos => of_numbers(0, width, 0),
            F::Exp | F::Log => of_numbers(width, width, 0),
            F::Pow => of_numbers(width, 2 * width, 0),
            F::Tan | F::Sinh | F::Cosh | F::Tanh => of_numbers(3 * width, 2 * width, 0),
            F::Acos | F::Asin | F::Atan | F::Atan2 => of_numbers(ARC_OPERATIONS * width, width, 0),
            F::Unpack2x16float | F::Unpack2x16snorm | F::Unpack2x16unorm => of_numbers(0, 0, 2),
            F::Unpack4x8snorm | F::Unpack4x8unorm | F::Unpack4xI8 | F::Unpack4xU8 => of_numbers(0, 0, 8),
            F::Pack2x16float | F::Pack2x16snorm | F::Pack2x16unorm => of_numbers(0, 0, 2),
            F::Pack4x8snorm | F::Pack4x8unorm | F::Pack4xI8 | F::Pack4xU8 => of_numbers(0, 0, 8),
            _ => of_numbers(width, 0, 0),
        }
    }

    /// Returns the type of an expression.
    fn inner(&self, handle: Handle<Expression>) -> &TypeInner {
        self.info[handle].ty.inner_with(&self.module.types)
    }

    /// Returns how many numbers an expression is, and whether they are floating-point numbers; 1 word of other things.
    fn width(&self, handle: Handle<Expression>) -> (u64, bool) {
        let is_float = |scalar: &naga::Scalar| scalar.kind == ScalarKind::Float;
        match self.inner(handle) {
            TypeInner::Scalar(scalar) => (1, is_float(scalar)),
            TypeInner::Vector { size, scalar } => (*size as u64, is_float(scalar)),
            TypeInner::Matrix { columns, rows, scalar } => (*columns as u64 * *rows as u64, is_float(scalar)),
            other => (u64::from(other.size(self.module.to_ctx()) / 4).max(1), false),
        }
    }

    /// Returns the words of what a pointer leads to, padding left out of vectors.
    fn pointed_words(&self, pointer: Handle<Expression>) -> u64 {
        match self.inner(pointer) {
            TypeInner::Pointer { base, .. } => {
                u64::from(self.module.types[*base].inner.size(self.module.to_ctx()) / 4).max(1)
            }
            TypeInner::ValuePointer { size, .. } => size.map_or(1, |size| size as u64),
            _ => 1,
        }
    }

    /// Follows a pointer to its variable.
    fn memory(&self, pointer: Handle<Expression>) -> Memory {
        let (mut at, mut is_computed) = (pointer, false);
        loop {
            match self.function.expressions[at] {
                Expression::Access { base, .. } => {
                    is_computed |= matches!(self.pointed(base), Some(TypeInner::Array { .. }));
                    at = base;
                }
                Expression::AccessIndex { base, .. } => at = base,
                Expression::GlobalVariable(variable) => {
                    return match self.module.global_variables[variable].space {
                        AddressSpace::Storage { .. } => Memory::Storage,
                        AddressSpace::Private if is_computed => Memory::ThreadArray,
                        _ => Memory::Other,
                    };
                }
                // A pointer that is an argument leads to a variable of the caller's.
                _ => return if is_computed { Memory::ThreadArray } else { Memory::Other },
            }
        }
    }

    /// Returns the type that a pointer leads to.
    fn pointed(&self, pointer: Handle<Expression>) -> Option<&TypeInner> {
        match self.inner(pointer) {
            TypeInner::Pointer { base, .. } => Some(&self.module.types[*base].inner),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use naga::Statement;
    use naga::valid::{Capabilities, ValidationFlags, Validator};

    const PRELUDE: &str = "
@group(0) @binding(0) var<storage, read_write> words: array<u32>;
@group(0) @binding(1) var<storage, read_write> vectors: array<vec4<f32>>;
fn f(x: vec3<f32>, y: vec3<f32>, s: f32, i: u32, m: mat3x3<f32>) {
    var a: array<u32, 8>;
    var local = x;
";

    /// Counts the statements of a function that has no branches.
    fn counts(statements: &str) -> OperationCounts {
        let source = format!("{PRELUDE}{statements}\n}}");
        let module = naga::front::wgsl::parse_str(&source).unwrap_or_else(|e| panic!("{}", e.emit_to_string(&source)));
        let info = Validator::new(ValidationFlags::all(), Capabilities::SHADER_FLOAT16_IN_FLOAT32).validate(&module);
        let info = info.unwrap();
        let (handle, function) = module.functions.iter().next().unwrap();
        let counted = Counted { module: &module, function, info: &info[handle] };
        let mut sum = OperationCounts::default();
        for statement in function.body.iter() {
            match statement {
                Statement::Emit(range) => range.clone().for_each(|handle| sum += counted.expression(handle)),
                Statement::Store { pointer, .. } => sum += counted.store(*pointer),
                _ => {}
            }
        }
        sum
    }

    #[test]
    fn operations_count_what_their_numbers_say() {
        let float = |float| OperationCounts { float, ..OperationCounts::default() };
        let integer = |integer| OperationCounts { integer, ..OperationCounts::default() };
        let none = OperationCounts::default();
        let cases = [
            ("let r = x + y;", float(3)),
            ("let r = s * x;", float(3)),
            ("let r = x * y + x;", float(6)),
            ("let r = fma(x, y, x);", float(6)),
            ("let r = -x;", none),
            ("let r = dot(x, y);", float(5)),
            ("let r = m * x;", float(15)),
            ("let r = m * m;", float(45)),
            ("let r = m * s;", float(9)),
            ("let r = x < y;", float(3)),
            ("let r = select(x, y, x < y);", float(6)),
            ("let r = x / y;", OperationCounts { float: 3, special: 3, ..none }),
            ("let r = sqrt(s);", OperationCounts { special: 1, ..none }),
            ("let r = normalize(x);", OperationCounts { float: 8, special: 1, ..none }),
            ("let r = i * 3u + 1u;", integer(2)),
            ("let r = f32(i);", integer(1)),
            ("let r = bitcast<f32>(i);", none),
            ("let r = unpack2x16float(i);", integer(2)),
            ("let r = local.y;", none),
            ("let r = words[i];", OperationCounts { integer: 1, loaded_words: 1, ..none }),
            ("let r = vectors[3];", OperationCounts { loaded_words: 4, ..none }),
            ("let r = vectors[i].y;", OperationCounts { integer: 1, loaded_words: 1, ..none }),
            ("words[i] = 1u;", OperationCounts { integer: 1, stored_words: 1, ..none }),
            ("let r = a[i];", OperationCounts { integer: 1, array_words: 1, ..none }),
            ("a[i] = i;", OperationCounts { integer: 1, array_words: 1, ..none }),
            ("let r = a[3];", none),
        ];
        // What the first line of the function takes is in all of them.
        assert_eq!(counts(""), none);
        for (statement, expected) in cases {
            assert_eq!(counts(statement), expected, "{statement}");
        }
    }
}
