-- An example of a module for Lmod, with the man page and the completions.
-- Unpack gdt-batch-VERSION-TARGET.tar.gz as /opt/apps/gdt-batch/VERSION, and copy this file to MODULES/gdt-batch/VERSION.lua.
-- Then `module load gdt-batch` gives the command to jobs: `gdt-batch submit job.toml --engine slurm --tasks 64`.
local version = myModuleVersion()
local root = pathJoin("/opt/apps/gdt-batch", version)

whatis("Name: gdt-batch")
whatis("Version: " .. version)
whatis("Description: point clouds of any size in, one exact Delaunay terrain out")
help([[
gdt-batch job.toml          runs a job
gdt-batch submit job.toml   sends it to Slurm
man gdt-batch               tells the rest
]])

prepend_path("PATH", pathJoin(root, "bin"))
-- Without MANPATH, man finds share/man beside the folders of PATH; with it, man looks nowhere else.
if os.getenv("MANPATH") then
  prepend_path("MANPATH", pathJoin(root, "share/man"))
end
-- Without XDG_DATA_DIRS these two count; with it, only what it names.
if not os.getenv("XDG_DATA_DIRS") then
  append_path("XDG_DATA_DIRS", "/usr/local/share")
  append_path("XDG_DATA_DIRS", "/usr/share")
end
prepend_path("XDG_DATA_DIRS", pathJoin(root, "share"))
