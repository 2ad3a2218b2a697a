//! SPIR-V in tests: `spirv-val` (Debian: spirv-tools; `make deps` installs it), and the instructions of a module.

use std::io::Write as _;
use std::process::{Command, Stdio};

/// `None` if the module is valid, else what the validator says.
pub fn validate(spirv: &[u8]) -> std::io::Result<Option<String>> {
    let mut child = Command::new("spirv-val")
        .args(["--target-env", "vulkan1.2", "-"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()?;
    child.stdin.take().expect("piped").write_all(spirv)?;
    let output = child.wait_with_output()?;
    let message = || String::from_utf8_lossy(&[output.stdout.as_slice(), &output.stderr].concat()).into_owned();
    Ok((!output.status.success()).then(message))
}

/// Whether there is a validator; says so if not.
pub fn validator_is_there() -> bool {
    let there = Command::new("spirv-val").arg("--version").output().is_ok();
    if !there {
        eprintln!("skipped: spirv-val is not installed (make deps installs it)");
    }
    there
}

pub fn assert_valid(name: &str, spirv: &[u8]) {
    let message = validate(spirv).expect("spirv-val runs");
    assert!(message.is_none(), "{name}: {}", message.unwrap_or_default());
}

pub fn bytes(words: &[u32]) -> Vec<u8> {
    words.iter().flat_map(|word| word.to_le_bytes()).collect()
}

pub fn words(bytes: &[u8]) -> Vec<u32> {
    bytes.chunks_exact(4).map(|w| u32::from_le_bytes([w[0], w[1], w[2], w[3]])).collect()
}

/// Opcode and operands of each instruction of a module.
pub fn instructions(spirv: &[u32]) -> Vec<(u32, &[u32])> {
    let mut rest = &spirv[5..];
    let mut all = Vec::new();
    while let [first, ..] = *rest {
        let (instruction, behind) = rest.split_at((first >> 16) as usize);
        all.push((first & 0xffff, &instruction[1..]));
        rest = behind;
    }
    all
}
