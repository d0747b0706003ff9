//! Puts counters into a shader: wherever its control flow joins or parts, what was done since is added to counters of the
//! thread, and at the end of an entry point these are added to a buffer.

use crate::operations::cost::Counted;
use crate::operations::counts::{COUNTERS, KINDS, OperationCounts, PARTS};
use naga::valid::{Capabilities, ValidationFlags, Validator};
use naga::{
    Arena, BinaryOperator, Block, Expression, Function, GlobalVariable, Handle, Literal, Module, Range, Span, Statement,
};

/// Declares the counters, and adds those of a thread to the buffer's.
const COUNTERS_WGSL: &str = include_str!("../shaders/counters.wgsl");
/// Capabilities of the shaders; those of ray queries are not among them.
const CAPABILITIES: Capabilities = Capabilities::SHADER_FLOAT16_IN_FLOAT32;

/// Returns the module of a shader that counts. `part_of` tells the part, below [`PARTS`], that a function belongs to.
///
/// # Errors
/// What is wrong with the text.
pub(crate) fn instrument(source: &str, part_of: &dyn Fn(&str) -> usize) -> Result<Module, String> {
    let source = format!("{source}\nconst COUNTERS: u32 = {COUNTERS}u;\n{COUNTERS_WGSL}");
    let options = naga::front::wgsl::Options { capabilities: CAPABILITIES, ..naga::front::wgsl::Options::new() };
    let mut module = naga::front::wgsl::Frontend::new_with_options(options)
        .parse(&source)
        .map_err(|error| error.emit_to_string(&source))?;
    let info = Validator::new(ValidationFlags::all(), CAPABILITIES)
        .validate(&module)
        .map_err(|error| error.emit_to_string(&source))?;
    let counters = module.global_variables.iter().find(|(_, variable)| variable.name.as_deref() == Some("counted"));
    let counters = counters.map(|(handle, _)| handle).ok_or("the shader has no counters")?;
    let named = |(_, function): &(Handle<Function>, &Function)| function.name.as_deref() == Some("add_counted");
    let finish =
        module.functions.iter().find(named).map(|(handle, _)| handle).ok_or("the counters are not added up")?;
    let handles: Vec<_> = module.functions.iter().map(|(handle, _)| handle).filter(|f| *f != finish).collect();
    for handle in handles {
        let function = module.functions[handle].clone();
        let part = part_of(function.name.as_deref().unwrap_or_default());
        let counted = Counted { module: &module, function: &function, info: &info[handle] };
        module.functions[handle] = Counting::new(&counted, counters, part, None).function();
    }
    for number in 0..module.entry_points.len() {
        let (function, name) = (module.entry_points[number].function.clone(), module.entry_points[number].name.clone());
        let counted = Counted { module: &module, function: &function, info: info.get_entry_point(number) };
        module.entry_points[number].function =
            Counting::new(&counted, counters, part_of(&name), Some(finish)).function();
    }
    Ok(module)
}

/// A function that is rewritten.
struct Counting<'a> {
    counted: &'a Counted<'a>,
    expressions: Arena<Expression>,
    /// Pointer to the counters.
    counters: Handle<Expression>,
    part: usize,
    /// What an entry point calls before it returns.
    finish: Option<Handle<Function>>,
}

impl<'a> Counting<'a> {
    fn new(
        counted: &'a Counted<'a>,
        counters: Handle<GlobalVariable>,
        part: usize,
        finish: Option<Handle<Function>>,
    ) -> Counting<'a> {
        let mut expressions = counted.function.expressions.clone();
        let counters = expressions.append(Expression::GlobalVariable(counters), Span::UNDEFINED);
        Counting { counted, expressions, counters, part: part.min(PARTS - 1), finish }
    }

    fn function(mut self) -> Function {
        let body = self.block(&self.counted.function.body);
        Function { body, expressions: self.expressions, ..self.counted.function.clone() }
    }

    fn block(&mut self, block: &Block) -> Block {
        let (mut out, mut since) = (Block::new(), OperationCounts::default());
        for (statement, span) in block.span_iter() {
            let rewritten = match statement {
                Statement::Emit(range) => {
                    range.clone().for_each(|handle| since += self.counted.expression(handle));
                    statement.clone()
                }
                Statement::Store { pointer, .. } => {
                    since += self.counted.store(*pointer);
                    statement.clone()
                }
                Statement::Block(inner) => {
                    self.add(&mut out, &mut since);
                    Statement::Block(self.block(inner))
                }
                Statement::If { condition, accept, reject } => {
                    since.branches += 1;
                    self.add(&mut out, &mut since);
                    Statement::If { condition: *condition, accept: self.block(accept), reject: self.block(reject) }
                }
                Statement::Switch { selector, cases } => {
                    since.branches += 1;
                    self.add(&mut out, &mut since);
                    let mut cases = cases.clone();
                    for case in &mut cases {
                        case.body = self.block(&case.body);
                    }
                    Statement::Switch { selector: *selector, cases }
                }
                Statement::Loop { body, continuing, break_if } => {
                    self.add(&mut out, &mut since);
                    let mut counted_body = Block::new();
                    self.add(&mut counted_body, &mut OperationCounts { branches: 1, ..OperationCounts::default() });
                    counted_body.append(&mut self.block(body));
                    let continuing = self.block(continuing);
                    Statement::Loop { body: counted_body, continuing, break_if: *break_if }
                }
                Statement::Return { .. } | Statement::Break | Statement::Continue | Statement::Kill => {
                    self.add(&mut out, &mut since);
                    if let (Statement::Return { .. }, Some(function)) = (statement, self.finish) {
                        let call = Statement::Call { function, arguments: Vec::new(), result: None };
                        out.push(call, Span::UNDEFINED);
                    }
                    statement.clone()
                }
                other => other.clone(),
            };
            out.push(rewritten, *span);
        }
        self.add(&mut out, &mut since);
        out
    }

    /// Adds the statements that count what was done `since`, which is nothing from then on.
    fn add(&mut self, out: &mut Block, since: &mut OperationCounts) {
        for (kind, count) in std::mem::take(since).numbers().into_iter().enumerate().filter(|(_, count)| *count > 0) {
            let mut append = |expression| self.expressions.append(expression, Span::UNDEFINED);
            let more = append(Expression::Literal(Literal::U32(count as u32)));
            let index = (KINDS * self.part + kind) as u32;
            let pointer = append(Expression::AccessIndex { base: self.counters, index });
            let before = append(Expression::Load { pointer });
            let sum = append(Expression::Binary { op: BinaryOperator::Add, left: before, right: more });
            out.push(Statement::Emit(Range::new_from_bounds(pointer, sum)), Span::UNDEFINED);
            out.push(Statement::Store { pointer, value: sum }, Span::UNDEFINED);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A shader whose loop runs as often as it is told, and calls a function of another part.
    const SHADER: &str = "
@group(0) @binding(0) var<storage, read_write> words: array<u32>;
fn other(x: u32) -> u32 {
    if x > 7u {
        return x;
    }
    return x + 1u;
}
@compute @workgroup_size(1)
fn main() {
    for (var i = 0u; i < words[0]; i++) {
        words[1] = other(words[1]);
    }
}";

    /// Returns the numbers of statements that add to each counter.
    fn additions(module: &Module) -> Vec<(u32, u32)> {
        let mut found = Vec::new();
        let functions = module.functions.iter().map(|(_, function)| function);
        for function in functions.chain(module.entry_points.iter().map(|entry| &entry.function)) {
            for (handle, expression) in function.expressions.iter() {
                let Expression::Binary { op: BinaryOperator::Add, left, right } = *expression else { continue };
                let Expression::Load { pointer } = function.expressions[left] else { continue };
                let Expression::AccessIndex { base, index } = function.expressions[pointer] else { continue };
                let (Expression::GlobalVariable(variable), Expression::Literal(Literal::U32(count))) =
                    (&function.expressions[base], &function.expressions[right])
                else {
                    continue;
                };
                if module.global_variables[*variable].name.as_deref() == Some("counted") {
                    assert!(function.expressions.iter().any(|(other, _)| other == handle));
                    found.push((index, *count));
                }
            }
        }
        found.sort_unstable();
        found
    }

    #[test]
    fn counted_shaders_are_valid_and_add_where_control_parts() {
        let part_of = |name: &str| usize::from(name == "other");
        let module = instrument(SHADER, &part_of).unwrap();
        Validator::new(ValidationFlags::all(), CAPABILITIES).validate(&module).unwrap();
        let kinds = KINDS as u32;
        // Of `other`, which is part 1: its comparison and its sum, and its branch. Of `main`: its comparison and its
        // sum, words read and written, and the loop's two branches.
        let expected = [
            vec![(2, 1), (2, 1), (3, 1), (3, 1), (4, 1), (6, 1), (6, 1)],
            vec![(kinds + 2, 1), (kinds + 2, 1), (kinds + 6, 1)],
        ];
        assert_eq!(additions(&module), expected.concat());
        // Planted: a shader that is none.
        assert!(instrument("fn main( {", &part_of).is_err());
    }
}
