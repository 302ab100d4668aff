//! Opening an SQLite database that comes from anybody. Its tables may say that SQLite is to compute what they hold: a few bytes can ask for
//! any amount of memory or time. So only plain tables are read, and views that only choose among their columns and rows, within limits that
//! follow from the file's size.

use std::collections::HashSet;
use std::path::Path;

use rusqlite::config::DbConfig;
use rusqlite::hooks::{AuthAction, AuthContext, Authorization};
use rusqlite::limits::Limit;
use rusqlite::{Connection, ErrorCode, OpenFlags};

use sys::{Error, interrupt};

/// A value may be as long as the file, or as so many bytes.
const LEAST_LENGTH: u64 = 1 << 20;

/// SQLite may take this share of the memory limit, and so much more.
const SHARE_OF_MEMORY: u64 = 8;
const BASE_MEMORY: u64 = 16 << 20;

/// Bytes of pages that a connection keeps, in KiB. Tables are read once from beginning to end.
const CACHE: i32 = 256;

/// Between so many steps of a query it is checked whether it should stop.
const STEPS: i32 = 10_000;

/// A query may take so many steps, and so many more for each byte of the file.
const LEAST_STEPS: u64 = 10_000_000;
const STEPS_PER_BYTE: u64 = 100;

/// Functions that make nothing longer, and whose time follows from the length of their values.
const FUNCTIONS: [&str; 15] = [
    "typeof",
    "row_number",
    "lower",
    "upper",
    "coalesce",
    "ifnull",
    "nullif",
    "iif",
    "abs",
    "round",
    "trim",
    "length",
    "min",
    "max",
    "count",
];

/// A table of the database, or a view.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct TableName {
    pub(super) name: String,
    pub(super) is_view: bool,
}

/// A column of a table.
pub(super) struct Column {
    pub(super) name: String,
    /// Whether it alone is the key.
    pub(super) is_key: bool,
    /// Whether its values are computed from others (`GENERATED ALWAYS`).
    pub(super) is_computed: bool,
}

/// Opens the file of `size` bytes for reading, and returns its plain tables and its views. A job may take `memory` bytes.
pub(super) fn open(path: &Path, size: u64, memory: u64) -> rusqlite::Result<(Connection, Vec<TableName>)> {
    let escaped: String = path.as_os_str().as_encoded_bytes().iter().map(escape).collect();
    let flags = OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_URI | OpenFlags::SQLITE_OPEN_NO_MUTEX;
    // `immutable` keeps SQLite from making files beside it, which may not be allowed.
    let mut file = Connection::open_with_flags(format!("file:{escaped}?immutable=1"), flags)?;
    set_limits(&file, size, memory)?;
    limit_steps(&mut file, size)?;
    let tables = tables_of(&file)?;
    authorize(&mut file, &tables)?;
    Ok((file, tables))
}

/// Returns the error about a file whose query failed.
pub(super) fn broken(path: &Path, error: &rusqlite::Error) -> Error {
    let how =
        format!("write its layer again as a plain table, for example with `ogr2ogr lines.gpkg {}`", path.display());
    let what = match error.sqlite_error_code() {
        Some(ErrorCode::OperationInterrupted) if interrupt::check().is_err() => return Error::Interrupted,
        Some(ErrorCode::OperationInterrupted) => format!("takes too long to read for a file of its size: {how}"),
        Some(ErrorCode::OutOfMemory) => {
            format!("takes more memory to read than [limits] memory allows: raise that, or {how}")
        }
        // SQLite has no code for a function that is not allowed.
        code if code == Some(ErrorCode::AuthorizationForStatementDenied)
            || error.to_string().starts_with("not authorized") =>
        {
            format!("would have SQLite compute what it holds ({}): {how}", what_is_computed(error))
        }
        _ => format!("is not a readable GeoPackage: {error}"),
    };
    Error::input(path, what)
}

/// Returns which part of a query is not allowed. SQLite names the function, but of a view only a column.
fn what_is_computed(error: &rusqlite::Error) -> String {
    let text = error.to_string();
    match text.contains("is prohibited") {
        true => format!("a view that joins texts with ||, or a table of a module: {text}"),
        false => text,
    }
}

/// Returns the columns of a table or a view.
pub(super) fn columns_of(file: &Connection, table: &str) -> rusqlite::Result<Vec<Column>> {
    let mut columns = Vec::new();
    file.pragma(None, "table_xinfo", table, |row| {
        let (name, key, hidden): (String, i64, i64) = (row.get("name")?, row.get("pk")?, row.get("hidden")?);
        columns.push(Column { name, is_key: key == 1, is_computed: hidden > 1 });
        Ok(())
    })?;
    Ok(columns)
}

/// Returns what is wrong with the pages of a table; `None` if they are sound. SQLite reads damaged ones as if some rows were there twice, or not
/// at all.
pub(super) fn damage_of(file: &Connection, table: &str) -> rusqlite::Result<Option<String>> {
    let mut found = None;
    file.pragma(None, "quick_check", table, |row| {
        let what: String = row.get(0)?;
        found = found.take().or((what != "ok").then_some(what));
        Ok(())
    })?;
    Ok(found)
}

/// Writes a byte of a name as a URI takes it. Names need not be UTF-8.
fn escape(byte: &u8) -> String {
    match byte {
        b'%' | b'?' | b'#' | 0x80.. => format!("%{byte:02X}"),
        _ => char::from(*byte).into(),
    }
}

fn set_limits(file: &Connection, size: u64, memory: u64) -> rusqlite::Result<()> {
    let length = i32::try_from(size.max(LEAST_LENGTH)).unwrap_or(i32::MAX);
    for (limit, most) in [
        (Limit::SQLITE_LIMIT_LENGTH, length),
        (Limit::SQLITE_LIMIT_ATTACHED, 0),
        (Limit::SQLITE_LIMIT_TRIGGER_DEPTH, 1),
        (Limit::SQLITE_LIMIT_WORKER_THREADS, 0),
    ] {
        file.set_limit(limit, most)?;
    }
    file.set_db_config(DbConfig::SQLITE_DBCONFIG_DEFENSIVE, true)?;
    file.set_db_config(DbConfig::SQLITE_DBCONFIG_TRUSTED_SCHEMA, false)?;
    file.pragma_update(None, "cell_size_check", true)?;
    file.pragma_update(None, "cache_size", -CACHE)?;
    // What is sorted stays in memory, and goes to no file.
    file.pragma_update(None, "temp_store", "MEMORY")?;
    // It holds for the whole process, in which one file is read at a time.
    let heap = i64::try_from((memory / SHARE_OF_MEMORY).saturating_add(BASE_MEMORY)).unwrap_or(i64::MAX);
    file.pragma(None, "hard_heap_limit", heap, |_| Ok(()))
}

/// Lets a query end that takes more steps than any table needs, and any query if the process should stop.
fn limit_steps(file: &mut Connection, size: u64) -> rusqlite::Result<()> {
    let most = LEAST_STEPS.saturating_add(size.saturating_mul(STEPS_PER_BYTE));
    let mut steps = 0u64;
    let should_stop = move || {
        steps = steps.saturating_add(STEPS.unsigned_abs().into());
        steps > most || interrupt::check().is_err()
    };
    file.progress_handler(STEPS, Some(should_stop))
}

/// Returns what SQLite itself takes for a plain table or a view, and not for a virtual table, whose rows a module makes.
fn tables_of(file: &Connection) -> rusqlite::Result<Vec<TableName>> {
    let mut tables = Vec::new();
    file.pragma_query(None, "table_list", |row| {
        let (schema, name, kind): (String, String, String) = (row.get("schema")?, row.get("name")?, row.get("type")?);
        if schema == "main" && (kind == "table" || kind == "view") {
            tables.push(TableName { name, is_view: kind == "view" });
        }
        Ok(())
    })?;
    Ok(tables)
}

/// Returns the views that join texts. No function does that, so the authorizer is not asked, and a single step of a query may copy a long text.
fn joining_views(file: &Connection) -> rusqlite::Result<HashSet<String>> {
    let query = "SELECT name FROM sqlite_schema WHERE type = 'view' AND instr(sql, '||') > 0";
    file.prepare(query)?.query_map([], |row| row.get::<_, String>(0).map(|name| name.to_lowercase()))?.collect()
}

/// Lets queries read these tables, but for views that join texts, and call no functions but harmless ones.
fn authorize(file: &mut Connection, tables: &[TableName]) -> rusqlite::Result<()> {
    let joining = joining_views(file)?;
    let mut known: HashSet<String> = tables.iter().map(|table| table.name.to_lowercase()).collect();
    known.retain(|name| !joining.contains(name));
    let allows = move |context: AuthContext| {
        let is_allowed = match context.action {
            AuthAction::Select => true,
            AuthAction::Read { table_name, .. } => known.contains(&table_name.to_lowercase()),
            AuthAction::Function { function_name } => FUNCTIONS.contains(&function_name.to_lowercase().as_str()),
            AuthAction::Pragma { pragma_name, .. } => ["table_xinfo", "quick_check"].contains(&pragma_name),
            _ => false,
        };
        if is_allowed { Authorization::Allow } else { Authorization::Deny }
    };
    file.authorizer(Some(allows))
}
