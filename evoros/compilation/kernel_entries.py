"""The entries of kernels, in LLVM's language: each runs the missions of some rows of memory."""

_RUN_ROW = """
declare i32 @{run}(ptr, ptr, i64)

define void @evoros.run_row(i64 %rows, i64 %width, i64 %i) alwaysinline {{
  %result = alloca ptr
  %error = alloca ptr
  %offset = mul i64 %i, %width
  %row = add i64 %rows, %offset
  %status = call i32 @{run}(ptr %result, ptr %error, i64 %row)
  ret void
}}
"""

_EACH_ROW = """
define void @{entry}(i64 %rows, i64 %width, i64 %first, i64 %end) {{
entry:
  br label %loop
loop:
  %i = phi i64 [ %first, %entry ], [ %next, %body ]
  %more = icmp slt i64 %i, %end
  br i1 %more, label %body, label %done
body:
  call void @evoros.run_row(i64 %rows, i64 %width, i64 %i)
  %next = add i64 %i, 1
  br label %loop
done:
  ret void
}}
"""

_ROW_OF_THREAD = """
declare i32 @llvm.nvvm.read.ptx.sreg.tid.x()
declare i32 @llvm.nvvm.read.ptx.sreg.ctaid.x()
declare i32 @llvm.nvvm.read.ptx.sreg.ntid.x()

define ptx_kernel void @{entry}(i64 %rows, i64 %width, i64 %first, i64 %end) {{
  %thread = call i32 @llvm.nvvm.read.ptx.sreg.tid.x()
  %block = call i32 @llvm.nvvm.read.ptx.sreg.ctaid.x()
  %threads = call i32 @llvm.nvvm.read.ptx.sreg.ntid.x()
  %thread64 = zext i32 %thread to i64
  %block64 = zext i32 %block to i64
  %threads64 = zext i32 %threads to i64
  %before = mul i64 %block64, %threads64
  %place = add i64 %before, %thread64
  %i = add i64 %first, %place
  %more = icmp slt i64 %i, %end
  br i1 %more, label %body, label %done
body:
  call void @evoros.run_row(i64 %rows, i64 %width, i64 %i)
  br label %done
done:
  ret void
}}
"""

HOST_ENTRY = _RUN_ROW + _EACH_ROW
"""Runs the missions of some rows, each of ``width`` bytes, one after another."""

GPU_ENTRY = _RUN_ROW + _ROW_OF_THREAD
"""Runs the mission of one row in each thread."""
